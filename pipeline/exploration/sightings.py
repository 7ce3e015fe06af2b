"""The unseen ground that keyframes were expected to show, and whether they showed this ground."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Place, Pose, Poses, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration import visibility
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.frontiers import unseen_cells
from pipeline.exploration.viewpoint import Context
from pipeline.exploration.visibility_kernels import CameraView, SearchedTerrain
from pipeline.grid_map import GridMap, LayerType
from pipeline.labels import RAMP_TILT
from pipeline.robot import RobotModel
from pipeline.transforms import inverse, wrap_angle, yaw_of

MAX_MISSES = np.iinfo(np.uint8).max
"""Number of misses of a cell after which further misses are not counted."""
MAX_TURNED = np.deg2rad(5)
"""Maximum angle, rad, by which a robot that could not set out has turned."""
LAYERS = {
    "target": LayerType(np.bool_),
    "misses": LayerType(np.uint8),
    "missed_from": LayerType(np.float32, np.inf, (2,)),
}


@dataclass(frozen=True, eq=False)
class ViewPose:
    """A pose from which the robot looked for unseen ground.

    Attributes:
        keyframe: index of a keyframe.
        T_keyframe_view: the pose relative to the ``base_link`` of this keyframe.
        is_viewpoint: whether the pose is that of a viewpoint, not of the keyframe.
    """

    keyframe: int
    T_keyframe_view: Pose
    is_viewpoint: bool


class Sightings:
    """Counts how often ground that was expected in view was shown, and how often it was missed.

    A look misses the targets that it should have shown according to the newest map. Once the map shows a wall in
    front of them, for example a wall that was too near for the camera, the look has not missed them.

    Attributes:
        visibility_probabilities: (256,) probability that ground in view is shown, by the number of looks that missed
            it.
    """

    _layers: GridMap

    def __init__(self, robot: RobotModel, config: ExplorationConfig):
        self._robot = robot
        self._config = config
        self.visibility_probabilities = np.ones(MAX_MISSES + 1)
        # Numbers of cells by their number of earlier misses: cells that were shown, misses of these cells before they
        # were shown, and misses of cells that were not shown yet.
        self._shown = np.zeros(MAX_MISSES + 1, np.int64)
        self._missed_before_shown = np.zeros(MAX_MISSES + 1, np.int64)
        self._missed = np.zeros(MAX_MISSES + 1, np.int64)
        self._looks: list[ViewPose] = []
        self._counted = 0  # Number of looks whose misses have been counted
        # Indices of the looks that missed targets. The others are not counted again until keyframes move.
        self._in_vain: list[int] = []
        # The viewpoint to which the robot is driving, relative to the keyframe at which it set out.
        self._expected: ViewPose | None = None
        # Poses of the keyframes when their looks were counted.
        self._poses = np.zeros((0, 4, 4))

    @property
    def misses(self) -> NDArray[np.uint8]:
        """(nx, ny) number of looks that missed each cell, although the newest map puts the cell in their view."""
        return self._layers["misses"]

    def observe(self, context: Context, camera: CameraView) -> SearchedTerrain:
        """Count the cells that new keyframes show and that all looks missed; return the ground to be searched."""
        ground = context.traversability
        if not len(self._poses):
            self._layers = GridMap(ground.grid.cell, LAYERS)
        layers = self._layers
        guesses = self._config.visibility
        layers.match(ground.grid)
        self._add_looks(context.poses, ground)
        counted = self._count_shown(context, camera)
        layers.write("target", unseen_cells(context))
        seen = ~np.isnan(context.measured)
        terrain = SearchedTerrain(
            origin=layers.grid.origin,
            cell=layers.grid.cell,
            elevation=ground.sealed,
            gradient=ground.gradient,
            target=layers["target"],
            probability=np.ones(layers.grid.shape, np.float32),
            missed_from=np.full_like(layers["missed_from"], np.inf),
            falls=True,
            ramp_slope=float(np.tan(RAMP_TILT)),
            nist_slope=guesses.nist_slope,
            max_unknown_length=visibility.expected_sight_length(ground.tall, seen, layers.grid.cell, guesses),
            level_run=guesses.level_run,
            min_new_view_distance=guesses.min_new_view_distance,
        )
        self._count_misses(counted, context.poses, camera, terrain)
        # Adjacent cells are shown or missed together, so a strip as wide as the robot counts as one try.
        tries = self._robot.width / layers.grid.cell
        self.visibility_probabilities = visibility_probabilities(
            self._shown / tries, (self._missed_before_shown + self._missed) / tries
        )
        rounded = visibility.rounded(self.visibility_probabilities).astype(np.float32)
        return terrain._replace(probability=rounded[layers["misses"]], missed_from=layers["missed_from"])

    def expect(self, position: Place, heading: float, context: Context) -> None:
        """Remember the viewpoint, (2,) m and rad, to which the robot sets out."""
        T_map_viewpoint = context.traversability.pose_on_ground(position, heading)
        self._expected = ViewPose(len(context.poses) - 1, inverse(context.poses[-1]) @ T_map_viewpoint, True)

    def _add_looks(self, poses: Poses, ground: Traversability) -> None:
        """Add the looks of new keyframes, and that of the last viewpoint if the drive ended there or where it began.

        A robot that could not set out, or that sees nothing new from the viewpoint, must look for other ground. A
        keyframe taken elsewhere, or with another heading, does not show what can be seen from the viewpoint.
        """
        self._looks += [ViewPose(k, np.eye(4), False) for k in range(len(self._poses), len(poses))]
        look, self._expected = self._expected, None
        if look is None:
            return
        start, here, newest = poses[look.keyframe], poses[-1], len(poses) - 1
        viewpoint = start @ look.T_keyframe_view
        turned = abs(wrap_angle(yaw_of(here) - yaw_of(start)))
        if _are_near(here, start, self._config.goal_tolerance) and turned <= MAX_TURNED:
            self._looks.append(look)
        elif _are_near(here, viewpoint, self._config.goal_tolerance):
            arrived = ground.pose_on_ground(viewpoint[:2, 3], yaw_of(here))
            self._looks.append(ViewPose(newest, inverse(here) @ arrived, True))

    def _count_shown(self, context: Context, camera: CameraView) -> list[int]:
        """Count the targets that were shown; return the indices of the looks whose misses must be counted."""
        layers = self._layers
        before, new = self._poses, range(self._counted, len(self._looks))
        self._counted = len(self._looks)
        ahead = camera.far, 0.0, 0.0, 1.0
        moved = np.linalg.norm(((context.poses[: len(before)] - before) @ ahead)[:, :2], axis=1).max(initial=0.0)
        if moved >= layers.grid.cell:
            self._poses = context.poses
            return [*range(len(self._looks))]
        # Even a smaller move makes the map cover ground along its edges without showing it; opening removes such
        # cells.
        is_shown = ndimage.binary_opening(layers["target"] & ~np.isnan(context.measured), np.ones((3, 3)))
        shown = np.bincount(layers["misses"][is_shown], minlength=MAX_MISSES + 1)
        self._shown += shown
        # A cell that was shown after k misses had been missed after 0 to k - 1 misses.
        self._missed_before_shown += shown[::-1].cumsum()[::-1] - shown
        self._poses = np.concatenate([before, context.poses[len(before) :]])
        return [*self._in_vain, *new]

    def _count_misses(self, counted: list[int], poses: Poses, camera: CameraView, terrain: SearchedTerrain) -> None:
        """Count the targets that looks missed according to the newest map.

        Ground behind crests is assumed to fall. Only viewpoints are also expected to show decks there.
        """
        misses = np.zeros_like(self._layers["misses"])
        self._missed[:] = 0
        self._in_vain = []
        for n in counted:
            look, before = self._looks[n], self._missed.sum()
            T = poses[look.keyframe] @ look.T_keyframe_view
            for falls in (True, False) if look.is_viewpoint else (True,):
                visibility.count_misses(T, camera, terrain._replace(falls=falls), misses, self._missed)
            if self._missed.sum() > before:
                self._in_vain.append(n)
        self._layers.write("misses", misses)
        self._layers.write("missed_from", terrain.missed_from)


def _are_near(one: Pose, other: Pose, distance: float) -> bool:
    """Whether two poses are less than a horizontal distance apart, m."""
    return bool(np.linalg.norm(one[:2, 3] - other[:2, 3]) < distance)


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
