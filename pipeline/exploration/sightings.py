"""What keyframes should have shown of unseen ground, and what they did."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Poses
from pipeline.exploration import visibility
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.frontiers import unseen
from pipeline.exploration.posterior import MOST_MISSES, chances
from pipeline.exploration.viewpoint import Context
from pipeline.exploration.visibility_kernels import CameraView, SearchedTerrain
from pipeline.grid_map import GridMap, Layer
from pipeline.keyframes import Places
from pipeline.robot import RobotModel

NOWHERE = Places.joined([])
LAYERS = {"target": Layer(np.bool_), "misses": Layer(np.uint8), "missed_from": Layer(np.float32, np.inf, (2,))}


class Sightings:
    """Counts how often ground that should have been in view was shown, and how often it was missed.

    Attributes:
        chances: (256,) probability that ground in view shows, by the number of keyframes that missed it.
    """

    _layers: GridMap

    def __init__(self, robot: RobotModel, config: ExplorationConfig):
        self._robot, self._config = robot, config
        self.chances = np.ones(MOST_MISSES + 1)
        # Cells that were shown after so many misses, and that were missed once more after so many misses.
        self._shown, self._missed = np.zeros((2, MOST_MISSES + 1), np.int64)
        # The cells that the next keyframe should show, and the ends of the drive to it.
        self._expected, self._drive = NOWHERE, NOWHERE
        # Cells that viewpoints should have shown and did not, although their keyframes do not miss them.
        self._disappointing: list[Places] = []
        # Of the keyframes, as they were when their misses were counted.
        self._poses = np.zeros((0, 4, 4))

    @property
    def misses(self) -> NDArray[np.uint8]:
        """(nx, ny) number of keyframes that should have shown each cell, by the newest map, and did not."""
        return self._layers["misses"]

    def observe(self, context: Context, camera: CameraView) -> SearchedTerrain:
        """Count what the keyframes since the last call showed and did not; the ground that is left to be searched."""
        ground = context.traversability
        if not len(self._poses):
            self._layers = GridMap(ground.grid.cell, LAYERS)
        layers, guesses = self._layers, self._config.visibility
        layers.match(ground.grid)
        first = self._count_shown(context, camera)
        layers.write("target", unseen(context))
        seen = ~np.isnan(context.measured)
        terrain = SearchedTerrain(
            origin=layers.grid.origin,
            cell=layers.grid.cell,
            elevation=ground.sealed,
            gradient=ground.gradient,
            target=layers["target"],
            probability=np.ones(layers.grid.shape, np.float32),
            missed_from=layers["missed_from"].copy(),
            falls=True,
            ramp_slope=guesses.ramp_slope,
            nist_slope=guesses.nist_slope,
            most_unknown=visibility.expected_depth(ground.tall, seen, layers.grid.cell, guesses),
            level_run=guesses.level_run,
            new_view=guesses.new_view,
        )
        self._count_misses(context.poses, first, camera, terrain)
        # Cells side by side show or hide together: as many as the robot is wide are one try.
        tries = self._robot.width / layers.grid.cell
        self.chances = chances(self._shown / tries, self._missed / tries)
        rounded = visibility.rounded(self.chances).astype(np.float32)
        return terrain._replace(probability=rounded[layers["misses"]], missed_from=layers["missed_from"])

    def expect(self, cells: Cells, drive: NDArray[np.float64], poses: Poses) -> None:
        """Remember the cells that the next keyframe should show, and the ends (2, 2) of the drive to it, m."""
        newest = len(poses) - 1
        self._expected = Places.anchored(self._layers.grid.centre_of(cells), poses, newest)
        self._drive = Places.anchored(drive, poses, newest)

    def _count_shown(self, context: Context, camera: CameraView) -> int:
        """Count which targets were shown; the number of the first keyframe whose misses are still to be counted."""
        layers, before = self._layers, self._poses
        first, ahead = len(before), (camera.far, 0.0, 0.0, 1.0)
        moved = np.linalg.norm(((context.poses[:first] - before) @ ahead)[:, :2], axis=1).max(initial=0.0)
        if moved < layers.grid.cell:
            # Along the rims of what was seen, also a map that moved by less covers ground without showing it.
            is_shown = ndimage.binary_opening(layers["target"] & ~np.isnan(context.measured), np.ones((3, 3)))
            self._shown += np.bincount(layers["misses"][is_shown], minlength=MOST_MISSES + 1)
            self._poses = np.concatenate([before, context.poses[first:]])
            return first
        # What was missed from corrected poses is found anew.
        self._poses, self._missed[:] = context.poses, 0
        layers.write("misses", np.zeros_like(layers["misses"]))
        layers.write("missed_from", np.full_like(layers["missed_from"], np.inf))
        return 0

    def _count_misses(self, poses: Poses, first: int, camera: CameraView, terrain: SearchedTerrain) -> None:
        """Count which targets the keyframes from number ``first`` on should have shown, by the newest map."""
        misses, missed_from = self._layers["misses"].copy(), terrain.missed_from
        visibility.count_misses(poses[first:], camera, terrain, misses, self._missed)
        self._note_disappointment(missed_from, poses)
        for cells in self._disappointing:
            if cells.keyframe[0] >= first:
                again = self._layers.grid.mask_of(cells.at(poses)) & terrain.target
                misses[again] += misses[again] < MOST_MISSES
                missed_from[again] = poses[cells.keyframe[0], :2, 3]
        self._layers.write("misses", misses)
        self._layers.write("missed_from", missed_from)

    def _note_disappointment(self, missed_from: NDArray[np.float32], poses: Poses) -> None:
        """Note the cells that the last viewpoint should have shown if the drive ended there, or where it began.

        Those that the newest keyframe missed are left out: these count already. A robot that could not set out, or
        sees no more than before where it wanted to look, must turn to something else; but a keyframe from elsewhere
        says nothing of what was to be seen.
        """
        here = poses[-1, :2, 3]
        drive = np.linalg.norm(here - self._drive.at(poses)[:, :2], axis=1)
        expected = self._layers.grid.mask_of(self._expected.at(poses)) & self._layers["target"]
        expected &= (missed_from != here.astype(np.float32)).any(axis=2)
        if (drive < self._config.arrived).any() and expected.any():
            centres = self._layers.grid.centre_of(np.argwhere(expected))
            self._disappointing.append(Places.anchored(centres, poses, len(poses) - 1))
        self._expected = self._drive = NOWHERE
