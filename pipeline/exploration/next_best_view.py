"""Frontier exploration on the metric map: the next best view."""

from collections.abc import Callable, Sequence
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.exploration import visibility
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.viewpoint import ARRIVED, Context, Viewpoint
from pipeline.grid_map import GridMap, Layer, best_of_blocks
from pipeline.keyframes import Places
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle
from pipeline.traversability.elevation_map import CELL
from pipeline.traversability.pose_kernels import ANGLES, STOP
from pipeline.traversability.pose_paths import bits

MIN_GAIN, MIN_RATE = 0.03, 1 / 3600
"""m² and m²/s, 1 m² per hour; a viewpoint that is expected to show less is not worth the drive, nor its risk."""
IS_THERE, IS_SHOWN = 0.9, 0.7
"""Probabilities that ground which should be in view is there at first, and that a keyframe shows ground in view."""
EXPERIENCE = 1.0
"""m² of missed ground that the robot looks for again until what it finds counts as much as these numbers."""
KEYFRAME_TIME = 2.0
"""s that a keyframe costs in addition to the way."""


NOWHERE = Places.joined([])


def chances_after_misses() -> NDArray[np.float64]:
    """(K,) probability, by Bayes' rule, that ground is there after 0, 1, … keyframes that should have shown it.

    Ground that is there with a lower probability, less than ground that is not there had at first, is given up.
    """
    chances = [IS_THERE]
    while chances[-1] > 1 - IS_THERE:
        missed = chances[-1] * (1 - IS_SHOWN)
        chances.append(missed / (missed + 1 - chances[-1]))
    return np.array(chances[:-1])


CHANCES = chances_after_misses()


class ViewpointRewards(Protocol):
    """Rewards that make a viewpoint worth a drive besides unseen ground."""

    @property
    def wanted(self) -> Sequence[object]:
        """What is to be seen; empty if there are no rewards."""
        ...

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) m², rewards of keyframes from (N, 3) places on the ground along (M,) bearings (rad)."""
        ...

    def aim(self, place: NDArray[np.float64], heading: float) -> None:
        """Remember that the next keyframe is to be taken from a place (3,) on the ground along a heading (rad)."""
        ...


class Exploration:
    """Chooses the viewpoint that is expected to show most per second of driving.

    Attributes:
        rewards: of viewpoints, besides unseen ground; None for no such rewards.
    """

    def __init__(self, robot: RobotModel):
        """``robot``: the range of its camera limits what keyframes are expected to show."""
        self.rewards: ViewpointRewards | None = None
        self._robot = robot
        self._layers = GridMap(
            CELL,
            {
                "elevation": Layer(np.float32, np.nan),
                "gradient": Layer(np.float32, per_cell=(2,)),
                "target": Layer(np.bool_),
                "misses": Layer(np.uint8),
                "probability": Layer(np.float32, CHANCES[0]),
                "missed_from": Layer(np.float32, np.inf, per_cell=(2,)),
            },
        )
        # The cells that the next keyframe should show, and the ends of the drive to it.
        self._expected, self._drive = NOWHERE, NOWHERE
        # The cells that a keyframe should have shown and did not, for each such keyframe.
        self._missed: list[Places] = []
        self._poses = np.zeros((0, 4, 4))
        # By the number of misses, m² in which ground was looked for, and in which it was shown.
        self._looked_for = np.full(len(CHANCES), EXPERIENCE)
        self._shown = EXPERIENCE * CHANCES
        self._viewpoint_gains, self._revision = visibility.ViewpointGains(), 0
        self._falls = True  # whether unknown ground behind crests is assumed to fall

    def observe(self, context: Context) -> None:
        """Record which cells the last keyframe should have shown and did not, and where unseen ground is left."""
        self._layers.match(context.traversability.grid)
        self._place(context.poses)
        self._count_misses(context.measured, context.poses)
        self._write_terrain(context)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that shows most per second; None if no viewpoint is worth a keyframe."""
        is_left = self._terrain.target.any() or (self.rewards and self.rewards.wanted)
        if context.paths.start is None or not is_left:
            return None
        camera = visibility.camera_view(context.frame)
        # A deck behind a crest shows from below, ground that falls does not: the robot looks for decks last.
        for cells_of, falls in ((_spread, True), (self._narrow, True), (_spread, False)):
            self._falls = falls
            if viewpoint := self._best_viewpoint(context, camera, cells_of):
                return viewpoint
        return None

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember what a keyframe from this viewpoint should show."""
        camera = visibility.camera_view(context.frame)
        in_view = visibility.cells_in_view(viewpoint.position, viewpoint.heading, camera, self._terrain)
        newest = len(context.poses) - 1
        centres = self._layers.grid.centre_of(np.argwhere(in_view))
        self._expected = Places.anchored(centres, context.poses, newest)
        ends = np.stack([context.T_map_base[:2, 3], viewpoint.position])
        self._drive = Places.anchored(ends, context.poses, newest)
        if self.rewards is not None:
            place = context.traversability.on_ground(viewpoint.position[None])[0]
            self.rewards.aim(place, viewpoint.heading)

    @property
    def chances(self) -> NDArray[np.float64]:
        """(K,) probability that ground is there after 0, 1, … misses, by Bayes' rule and what the robot has found."""
        # At first sight ground stays likely: beyond a rim there is none, but behind the next corner there may be.
        return np.append(CHANCES[0], np.minimum.accumulate(self._shown / self._looked_for)[1:])

    def find_frontiers(self, context: Context) -> NDArray[np.float64]:
        """(N, 3) centres of the connected pieces of reachable ground that border on unseen ground, m in ``map``."""
        traversability, target = context.traversability, self._terrain.target
        side = 2 * round(self._robot.corner_radius / traversability.grid.cell) + 1
        # The ground that the robot's corners may touch around unseen cells; many times as fast as SciPy's filter.
        around = cv2.dilate(target.view(np.uint8), np.ones((side, side), np.uint8)).view(np.bool_)
        pieces, _ = ndimage.label(around & context.paths.reachable & ~target, np.ones((3, 3)))
        centres = []
        for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
            cells = np.argwhere(pieces[box] == piece) + [side.start for side in box]
            middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
            centres.append([*traversability.grid.centre_of(middle), traversability.elevation[tuple(middle)]])
        return np.array(centres).reshape(-1, 3)

    def worth(self, gains: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 16) scores of viewpoints, of which the greatest is chosen: 0 for those not worth the drive.

        Args:
            gains: (N, 16) m² that each viewpoint is expected to show.
            seconds: (N, 16) s until the keyframe is taken.
        """
        return np.where((gains >= MIN_GAIN) & (gains >= MIN_RATE * seconds), gains / seconds, 0.0)

    def _narrow(self, context: Context, camera: kernels.CameraView) -> NDArray[np.int64]:
        """(N, 2) all reachable cells where the robot cannot turn around, near ground taken for level at the start.

        With its back to the wall of a small room, or on a ramp that it backed up, the robot sees ground that is
        otherwise nearer than the range of its camera.
        """
        traversability, paths = context.traversability, context.paths
        assumed = self._terrain.target & paths.reachable
        near = traversability.grid.distance_to(assumed) <= camera.reach
        return np.argwhere(paths.reachable & ~traversability.turnable & near)

    def _best_viewpoint(
        self, context: Context, camera: kernels.CameraView, cells_of: Callable[..., NDArray[np.int64]]
    ) -> Viewpoint | None:
        """The best viewpoint where the robot stands or in the cells (N, 2) of ``cells_of``; None if there is none."""
        traversability, paths = context.traversability, context.paths
        assert paths.start is not None
        cells = cells_of(context, camera)
        candidates = np.vstack([paths.start, traversability.grid.centre_of(cells)])
        gains = self._gains(paths.start, cells, camera)
        if self.rewards and self.rewards.wanted:
            gains = gains + self.rewards.gains(traversability.on_ground(candidates), ANGLES)
        there = np.vstack([traversability.grid.cell_of(paths.start), cells])
        gains = np.where(bits(paths.headings[tuple(there.T)]), gains, 0.0)
        is_some = (gains >= MIN_GAIN).any(axis=1)
        if not is_some.any():
            return None
        candidates, gains, there = candidates[is_some], gains[is_some], there[is_some]
        horizon, straight = STOP, paths.least_seconds_to(there)[:, None]
        while True:
            known = paths.seconds_to(there, horizon)
            # Ways beyond the search's horizon cost more than the horizon, and no less than a straight drive.
            least = np.minimum(known, np.inf if paths.is_complete else np.maximum(straight, horizon))
            worth = self.worth(gains, KEYFRAME_TIME + least)
            n, m = np.unravel_index(worth.argmax(), worth.shape)
            if worth[n, m] <= 0 or (paths.is_complete and np.isinf(known[n, m])):
                return None
            if np.isfinite(known[n, m]):
                return Viewpoint(candidates[n], wrap_angle(float(ANGLES[m])), True, float(gains[n, m]))
            horizon *= 2

    def _place(self, poses: NDArray[np.float64]) -> None:
        """Count the misses of all cells anew if the poses (K, 4, 4) of keyframes were corrected."""
        known, self._poses = self._poses, poses
        if np.array_equal(known, poses[: len(known)]):
            return
        misses, missed_from = (np.full_like(self._layers[n], f) for n, f in (("misses", 0), ("missed_from", np.inf)))
        for missed in self._missed:
            cells = tuple(np.argwhere(self._layers.grid.mask_of(missed.at(poses))).T)
            misses[cells] += 1
            missed_from[cells] = poses[missed.keyframe[0], :2, 3]
        # A correction may have brought missed cells together.
        self._layers.write("misses", np.minimum(misses, len(CHANCES)))
        self._layers.write("missed_from", missed_from)

    def _count_misses(self, measured: NDArray[np.float32], poses: NDArray[np.float64]) -> None:
        """Record which cells the last keyframe should have shown and did not, and how often such cells are shown."""
        cells = np.argwhere(self._layers.grid.mask_of(self._expected.at(poses)))
        # A correction of the map may have brought a cell here that was given up.
        misses = np.minimum(self._layers["misses"][tuple(cells.T)], len(CHANCES) - 1)
        is_shown = ~np.isnan(measured[tuple(cells.T)])
        position = poses[-1, :2, 3]
        drive = np.linalg.norm(position - self._drive.at(poses)[:, :2], axis=1)
        stayed, arrived = drive < ARRIVED if len(drive) else (False, False)
        # A keyframe from elsewhere, after a drive that failed, tells nothing of how often missed ground shows.
        if arrived:
            self._looked_for += CELL**2 * np.bincount(misses, minlength=len(CHANCES))
            self._shown += CELL**2 * np.bincount(misses[is_shown], minlength=len(CHANCES))
        # A robot that could not set out must turn to something else.
        if arrived or stayed:
            missed = cells[~is_shown]
            self._layers.write("misses", misses[~is_shown] + 1, tuple(missed.T))
            self._layers.write("missed_from", position, tuple(missed.T))
            if len(missed):
                self._missed.append(Places.anchored(self._layers.grid.centre_of(missed), poses, len(poses) - 1))
        self._expected = NOWHERE

    def _write_terrain(self, context: Context) -> None:
        """Update the layers of the ground; unseen ground that may be traversable is a target until it is given up."""
        # Unknown ground nearer to a hazard than half of the robot cannot be driven on.
        layers, may_be_driven = self._layers, context.traversability.to_hazard >= self._robot.half_width
        chances = self.chances
        # Rounded, so that rays are cast anew only when they change much.
        rounded = np.where(chances < 1 - IS_THERE, 0.0, np.round(chances, 1))
        probability = np.append(rounded, 0.0).astype(np.float32)[layers["misses"]]
        layers.write("elevation", context.traversability.sealed)
        layers.write("gradient", context.traversability.gradient)
        layers.write("probability", probability)
        layers.write("target", np.isnan(context.measured) & may_be_driven & (probability > 0))

    @property
    def _terrain(self) -> kernels.SearchedTerrain:
        """The ground as known after the last keyframe."""
        names = ("elevation", "gradient", "target", "probability", "missed_from")
        layers = {name: self._layers[name] for name in names}
        return kernels.SearchedTerrain(self._layers.grid.origin, CELL, falls=self._falls, **layers)

    def _gains(
        self, here: NDArray[np.float64], cells: NDArray[np.int64], camera: kernels.CameraView
    ) -> NDArray[np.float64]:
        """(1 + N, 16) m² that each viewpoint should show, at the place ``here`` (2,), m, and in the cells (N, 2)."""
        changed, self._revision = self._layers.changed_since(self._revision), self._layers.revision
        around = self._viewpoint_gains.of(cells, camera, self._terrain, changed)
        return np.vstack([visibility.gains(here[None], camera, self._terrain), around])


def _spread(context: Context, _: kernels.CameraView) -> NDArray[np.int64]:
    """(N, 2) cells: of each block the one with the most reachable headings."""
    return best_of_blocks(np.bitwise_count(context.paths.headings), visibility.PLACE_STRIDE)
