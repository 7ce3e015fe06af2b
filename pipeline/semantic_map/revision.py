"""Revises the classes of the semantic map's points with the help of the other maps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Labels, Places, Points
from pipeline.elevation_map.accessibility import is_inaccessible
from pipeline.elevation_map.traversability import Traversability
from pipeline.labels import Label
from pipeline.semantic_map.finds import with_finds
from pipeline.semantic_map.uprights import RAMPS, with_whole_uprights

SKIN = 0.03
"""Points within this distance of the points of a find belong to the find, m."""


@dataclass(frozen=True, eq=False)
class Revision:
    """A snapshot of the other maps; :meth:`revised` makes the labels of a semantic map consistent with them.

    Attributes:
        ground: traversability of the ground.
        places: (K, 3) positions where the robot has been, m in ``map``.
        highest_camera: greatest height of the robot's camera so far, m in ``map``.
        signs: points of each sign or code that was found.
        people: points of each person that was found.
    """

    ground: Traversability
    places: Places
    highest_camera: float
    signs: Sequence[Points]
    people: Sequence[Points]

    def revised(self, points: Points, labels: Labels, voxel: float) -> Labels:
        """Labels of a map's points (N, 3), m, that are consistent with each other and with the other maps."""
        robot = self.ground.robot
        labels = labels.copy()
        # A surface that is labelled as a ramp but cannot carry the robot, such as a table top, is clutter.
        ramps = np.flatnonzero(np.isin(labels, RAMPS))
        ramp_points = points[ramps]
        from_below = (labels[ramps] == Label.STRAIGHT_RAMP) & (ramp_points[:, 2] > self.highest_camera)
        labels[ramps[is_inaccessible(self.ground, self.places, ramp_points, from_below)]] = Label.CLUTTER
        # Walls and the sides of ramps have one class from top to bottom.
        labels = with_whole_uprights(points, labels, robot, voxel, self.ground.grid.cell)
        # Signs are clutter, and people victims.
        return with_finds(points, labels, self.signs, self.people, robot.max_step, SKIN)
