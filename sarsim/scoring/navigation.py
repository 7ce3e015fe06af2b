"""Scores of the robot's driving, and the time that it spends on each activity."""

from collections.abc import Sequence
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np

from pipeline.arrays import Mask, Places, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.commands import Outcome
from pipeline.navigation.navigator import Navigator
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle, yaw_of
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.robots.pose import TrajectorySample
from sarsim.scoring.oracle import true_traversability
from sarsim.scoring.trajectory import MAX_STILL_STEP, MIN_CARRIED_STEP, distance_driven, motion_figures
from sarsim.simulated_robot import SimulatedRobot


class NavigationScore:
    """Scores a robot's driving, whatever controls the robot."""

    def __init__(self, robot: SimulatedRobot, surface: GroundTruthSurface):
        """Start scoring at the robot's current pose; ``surface``: the true ground."""
        self._robot, self._surface, self._first = robot, surface, len(robot.trajectory) - 1

    @cached_property
    def ground(self) -> Traversability:
        """The true ground, as the robot's planner would represent it."""
        return true_traversability(self._surface, self._robot.model)

    def report(self) -> dict[str, Any]:
        """The figures for report.json; speed and times are missing if the robot received no command."""
        trajectory = self._robot.trajectory[self._first :]
        contacts = self._robot.collisions
        counts = {"collisions": contacts.collisions, "person_contacts": contacts.with_people}
        figures: dict[str, Any] = {**counts, **motion_figures(self._robot.trajectory)}
        if len(trajectory) > 1:
            figures["mean_speed"] = distance_driven(trajectory) / (trajectory[-1].time - trajectory[0].time)
            figures["time_s"] = time_figures(trajectory, self.ground)
        return figures


def navigation_figures(navigator: Navigator, score: NavigationScore, kidnaps: int) -> dict[str, Any]:
    """The figures of all drives for report.json; ``kidnaps``: number of times that the robot was carried."""
    ratios = [
        time.planned / time.actual for time in navigator.drive_durations if time.actual > 0 and time.planned > 0
    ]
    return {
        "legs": len(navigator.legs),
        "reached": sum(leg.outcome is Outcome.REACHED for leg in navigator.legs),
        "kidnapped": kidnaps,
        "stuck": sum(leg.outcome is Outcome.STUCK for leg in navigator.legs),
        "recovered": navigator.recoveries,
        **({"planned_over_driven": float(np.median(ratios))} if ratios else {}),
        **score.report(),
    }


class Activity(IntEnum):
    """The robot's activity in a control period."""

    DRIVING = 0
    TURNING = 1
    """In place: the centre of rotation is less than half the robot's width from the robot's centre."""
    BACKING = 2
    STILL = 3


def time_figures(trajectory: Sequence[TrajectorySample], ground: Traversability) -> dict[str, float]:
    """The figures ``navigation.time_s`` for report.json.

    Args:
        trajectory: true poses, one per control period.
        ground: the true ground, assessed for the robot that was driven.

    Returns:
        Times, s, spent driving, backing, turning in place and standing still, which sum to the total, and the parts
        of the driving time that were spent in narrow places (see :func:`is_narrow`) and on ramps.
    """
    doing, lasted = activities(trajectory, ground.robot), np.diff([pose.time for pose in trajectory])
    is_driving = doing == Activity.DRIVING
    places = np.array([[*pose.T_world_base[:2, 3], yaw_of(pose.T_world_base)] for pose in trajectory[1:]])
    places, driving = places[is_driving], lasted[is_driving]
    on_ramp = ground.grid.at(ground.ramp, places)
    each = {kind.name.lower(): float(lasted[doing == kind].sum()) for kind in Activity}
    return each | {"narrow": float(driving[is_narrow(ground, places)].sum()), "ramp": float(driving[on_ramp].sum())}


def activities(trajectory: Sequence[TrajectorySample], robot: RobotModel) -> Values:
    """(N - 1,) :class:`Activity` between N true poses; ``STILL`` while the robot is carried."""
    T = np.array([pose.T_world_base for pose in trajectory])
    steps = np.diff(T[:, :2, 3], axis=0)
    moved = np.linalg.norm(steps, axis=1)
    ahead = np.einsum("ij,ij->i", steps, T[:-1, :2, 0])
    headings = np.arctan2(T[:, 1, 0], T[:, 0, 0])
    swung = np.abs(wrap_angle(np.diff(headings))) * robot.half_width
    doing = np.where(ahead < 0, Activity.BACKING, Activity.DRIVING)
    doing[swung > moved] = Activity.TURNING
    doing[(np.maximum(moved, swung) <= MAX_STILL_STEP) | (moved >= MIN_CARRIED_STEP)] = Activity.STILL
    return doing


def is_narrow(ground: Traversability, places: Places) -> Mask:
    """(N,) bool, whether the room on the robot's left and right adds up to less than the robot's width.

    ``places``: (N, 3) x and y in m, heading in rad.
    """
    return side_clearance(ground, places, 1.0) + side_clearance(ground, places, -1.0) < ground.robot.width


def side_clearance(ground: Traversability, places: Places, side: float) -> Values:
    """(N,) m, distance from the footprint to the nearest obstacle on its left (1) or right (-1).

    At most the robot's width, and accurate to half a cell, because obstacles are sampled at intervals of one cell.
    """
    robot, cell = ground.robot, ground.grid.cell
    cos, sin = np.cos(places[:, 2]), np.sin(places[:, 2])
    ahead, left = np.column_stack([cos, sin]), side * np.column_stack([-sin, cos])
    away = np.arange(0.0, robot.width, cell)
    room = np.full(len(places), robot.width)
    for along in np.arange(-robot.half_length, robot.half_length + cell, cell):
        beside = places[:, :2] + along * ahead
        points = beside[:, None] + (robot.half_width + away + cell / 2)[:, None] * left[:, None]
        blocked = ground.grid.at(ground.obstacle, points, outside=1) != 0
        room = np.minimum(room, np.where(blocked.any(axis=1), away[blocked.argmax(axis=1)], robot.width))
    return room
