"""The unseen ground that keyframes were expected to show, and whether they showed this ground."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Poses, Values
from pipeline.exploration import visibility
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.frontiers import unseen_cells
from pipeline.exploration.viewpoint import Context
from pipeline.exploration.visibility_kernels import CameraView, SearchedTerrain
from pipeline.grid_map import GridMap, LayerType
from pipeline.keyframes import AnchoredPlaces
from pipeline.labels import RAMP_TILT
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle, yaw_of

MAX_MISSES = np.iinfo(np.uint8).max
"""Number of misses of a cell after which further misses are not counted."""
MAX_TURNED = np.deg2rad(5)
"""Maximum angle, rad, by which a robot that could not set out has turned."""
NO_PLACES = AnchoredPlaces.joined([])
LAYERS = {
    "target": LayerType(np.bool_),
    "misses": LayerType(np.uint8),
    "missed_from": LayerType(np.float32, np.inf, (2,)),
}


class Sightings:
    """Counts how often ground that was expected in view was shown, and how often it was missed.

    Attributes:
        visibility_probabilities: (256,) probability that ground in view is shown, by the number of keyframes that
            missed it.
    """

    _layers: GridMap

    def __init__(self, robot: RobotModel, config: ExplorationConfig):
        self._robot = robot
        self._config = config
        self.visibility_probabilities = np.ones(MAX_MISSES + 1)
        # Numbers of cells that were shown and that were missed again, by the number of earlier misses.
        self._shown = np.zeros(MAX_MISSES + 1, np.int64)
        self._missed = np.zeros(MAX_MISSES + 1, np.int64)
        # The cells that the next keyframe is expected to show, and the ends of the drive.
        self._expected = NO_PLACES
        self._drive = NO_PLACES
        # Cells that viewpoints were expected to show but did not, except those counted as misses of their keyframes.
        self._unshown: list[AnchoredPlaces] = []
        # Poses of the keyframes when their misses were counted.
        self._poses = np.zeros((0, 4, 4))

    @property
    def misses(self) -> NDArray[np.uint8]:
        """(nx, ny) number of keyframes that missed each cell, although the newest map puts the cell in their view."""
        return self._layers["misses"]

    def observe(self, context: Context, camera: CameraView) -> SearchedTerrain:
        """Count the cells shown and missed by the keyframes since the last call; return the ground to be searched."""
        ground = context.traversability
        if not len(self._poses):
            self._layers = GridMap(ground.grid.cell, LAYERS)
        layers = self._layers
        guesses = self._config.visibility
        layers.match(ground.grid)
        first = self._count_shown(context, camera)
        layers.write("target", unseen_cells(context))
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
            ramp_slope=float(np.tan(RAMP_TILT)),
            nist_slope=guesses.nist_slope,
            max_unknown_length=visibility.expected_sight_length(ground.tall, seen, layers.grid.cell, guesses),
            level_run=guesses.level_run,
            min_new_view_distance=guesses.min_new_view_distance,
        )
        self._count_misses(context.poses, first, camera, terrain)
        # Adjacent cells are shown or missed together, so a strip as wide as the robot counts as one try.
        tries = self._robot.width / layers.grid.cell
        self.visibility_probabilities = visibility_probabilities(self._shown / tries, self._missed / tries)
        rounded = visibility.rounded(self.visibility_probabilities).astype(np.float32)
        return terrain._replace(probability=rounded[layers["misses"]], missed_from=layers["missed_from"])

    def expect(self, cells: Cells, drive: NDArray[np.float64], poses: Poses) -> None:
        """Remember the cells that the next keyframe is expected to show, and the ends (2, 2) of its drive, m."""
        newest = len(poses) - 1
        self._expected = AnchoredPlaces.anchored(self._layers.grid.centre_of(cells), poses, newest)
        self._drive = AnchoredPlaces.anchored(drive, poses, newest)

    def _count_shown(self, context: Context, camera: CameraView) -> int:
        """Count the targets that were shown; return the index of the first keyframe with uncounted misses."""
        layers = self._layers
        before = self._poses
        first = len(before)
        ahead = camera.far, 0.0, 0.0, 1.0
        moved = np.linalg.norm(((context.poses[:first] - before) @ ahead)[:, :2], axis=1).max(initial=0.0)
        if moved < layers.grid.cell:
            # Even a smaller move makes the map cover ground along its edges without showing it; opening removes such
            # cells.
            is_shown = ndimage.binary_opening(layers["target"] & ~np.isnan(context.measured), np.ones((3, 3)))
            self._shown += np.bincount(layers["misses"][is_shown], minlength=MAX_MISSES + 1)
            self._poses = np.concatenate([before, context.poses[first:]])
            return first
        # The misses are counted again from the corrected poses.
        self._poses = context.poses
        self._missed[:] = 0
        layers.write("misses", np.zeros_like(layers["misses"]))
        layers.write("missed_from", np.full_like(layers["missed_from"], np.inf))
        return 0

    def _count_misses(self, poses: Poses, first: int, camera: CameraView, terrain: SearchedTerrain) -> None:
        """Count the targets that keyframes from index ``first`` on missed, according to the newest map."""
        misses = self._layers["misses"].copy()
        missed_from = terrain.missed_from
        visibility.count_misses(poses[first:], camera, terrain, misses, self._missed)
        self._note_unshown(missed_from, poses, camera)
        for cells in self._unshown:
            if cells.keyframe[0] >= first:
                again = self._layers.grid.mask_of(cells.at(poses)) & terrain.target
                misses[again] += misses[again] < MAX_MISSES
                missed_from[again] = poses[cells.keyframe[0], :2, 3]
        self._layers.write("misses", misses)
        self._layers.write("missed_from", missed_from)

    def _note_unshown(self, missed_from: NDArray[np.float32], poses: Poses, camera: CameraView) -> None:
        """If the last drive ended at its viewpoint or where it began, note the cells that should have been shown.

        Cells that the newest keyframe missed are left out, because they are counted already. A robot that could not
        set out, or that sees nothing new from the viewpoint, must look for other ground. A keyframe taken elsewhere,
        or with another heading, does not show whether the cells can be seen from the viewpoint.
        """
        here = poses[-1, :2, 3]
        drive = np.linalg.norm(here - self._drive.at(poses)[:, :2], axis=1)
        expected = self._layers.grid.mask_of(self._expected.at(poses)) & self._layers["target"]
        expected &= (missed_from != here.astype(np.float32)).any(axis=2)
        centres = self._layers.grid.centre_of(np.argwhere(expected))
        if (drive < self._config.goal_tolerance).any():
            yaw = yaw_of(poses[-1])
            turned = wrap_angle(yaw - yaw_of(poses[self._drive.keyframe[0]]))
            if drive[0] >= self._config.goal_tolerance or abs(turned) > MAX_TURNED:
                bearings = np.arctan2(*(centres - here).T[::-1])
                centres = centres[np.abs(wrap_angle(bearings - yaw)) <= camera.field_of_view / 2]
            if len(centres):
                self._unshown.append(AnchoredPlaces.anchored(centres, poses, len(poses) - 1))
        self._expected = self._drive = NO_PLACES


def visibility_probabilities(shown: Values, missed: Values) -> Values:
    """Probability that ground in view is shown after 0, 1, … misses: the means of Beta distributions.

    The prior follows Laplace's rule of succession: ground missed k times is shown in one of k + 1 tries. The
    probability is therefore k / (k + 1) times the probability after k - 1 misses. The run's tries are added to these
    k + 1 tries. The probability without misses stays 1, because there may be no ground beyond an outer edge, but some
    behind the next corner.

    Args:
        shown: number of tries that showed ground after 0, 1, … misses.
        missed: number of tries that missed ground again after 0, 1, … misses.
    """
    result = np.ones(len(shown))
    for k in range(1, len(shown)):
        result[k] = (k * result[k - 1] + shown[k]) / (k + 1 + shown[k] + missed[k])
    return result
