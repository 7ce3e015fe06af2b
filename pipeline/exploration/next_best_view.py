"""Frontier exploration on the metric map: the next best view."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.elevation_map.pose_kernels import ANGLES
from pipeline.exploration import visibility
from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.frontiers import near_ground, unseen
from pipeline.exploration.posterior import MOST_MISSES, Posterior
from pipeline.exploration.viewpoint import ARRIVED, Context, Viewpoint
from pipeline.grid_map import GridMap, Layer, best_of_blocks
from pipeline.keyframes import Places
from pipeline.planning.pose_paths import bits
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle

WORTHWHILE = np.log(1.002) / np.log(1.15)
"""Least growth of the ground seen, over that of the mission's time, both as logarithms: 0.2 % of ground for 15 % of
time. In foraging, 1 is where the marginal value theorem (Charnov 1976) leaves a patch for another; here the other
choice is to end."""
KEYFRAME_TIME = 2.0
"""s that a keyframe costs in addition to the way."""
NOWHERE = Places.joined([])


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
        takes_rewards: whether an :class:`pipeline.explorer.Explorer` gives it rewards for looking at victims again.
        rewards: of viewpoints, besides unseen ground; None for no such rewards.
        posterior: of what shows.
    """

    takes_rewards = True

    def __init__(self, robot: RobotModel, cell: float = 0.05):
        """For a robot and ground in cells of ``cell`` m."""
        self.rewards: ViewpointRewards | None = None
        self._robot = robot
        self._strip = robot.width * cell
        self.posterior = Posterior(robot.width / cell)
        self._layers = GridMap(
            cell,
            {
                "elevation": Layer(np.float32, np.nan),
                "gradient": Layer(np.float32, per_cell=(2,)),
                "target": Layer(np.bool_),
                "misses": Layer(np.uint8),
                "probability": Layer(np.float32, 1.0),
                "missed_from": Layer(np.float32, np.inf, per_cell=(2,)),
            },
        )
        # The cells that the next keyframe should show, and the ends of the drive to it.
        self._expected, self._drive = NOWHERE, NOWHERE
        # Cells that viewpoints should have shown and did not, although their keyframes do not miss them.
        self._in_vain: list[Places] = []
        # Of the keyframes, as they were when their misses were counted.
        self._poses: NDArray[np.float64] | None = None
        self._viewpoint_gains, self._revision = visibility.ViewpointGains(), 0
        self._falls = True  # whether unknown ground behind crests is assumed to fall
        self._began: float | None = None
        self._look_around = 2 * np.pi / robot.turn_rate + KEYFRAME_TIME
        self._duration, self._seen = self._look_around, 0.0

    def observe(self, context: Context) -> None:
        """Record what the keyframes since the last call showed and did not, and where unseen ground is left."""
        self._layers.match(context.traversability.grid)
        first = self._count_shown(context)
        self._write_ground(context)
        self._count_misses(context, first)
        # Rounded to half powers of two, so that rays are cast anew only when they change much.
        rounded = 2 ** (np.round(2 * np.log2(self.posterior.chances)) / 2)
        self._layers.write("probability", rounded[self._layers["misses"]])
        self._began = context.frame.time if self._began is None else self._began
        self._duration = self._look_around + context.frame.time - self._began
        self._seen = float(np.isfinite(context.measured).sum()) * self._layers.grid.cell**2

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that shows most per second; None if it is not worth the drive, nor what it may open."""
        viewpoints = (self._best_viewpoint(context, falls) for falls in (True, False))
        best = next((v for v in viewpoints if v and v.gain >= self.needed(v.seconds)), None)
        return best or self._opening(context)

    def _opening(self, context: Context) -> Viewpoint | None:
        """The first viewpoint left that is worth its time by the ground to which the way may be free, if any."""
        traversability, reachable = context.traversability, context.paths.reachable
        pieces, number = ndimage.label(traversability.traversable & ~reachable, np.ones((3, 3)))
        if not number:
            return None
        areas = np.bincount(pieces.ravel()) * traversability.grid.cell**2
        areas[0] = 0.0  # no piece
        for viewpoint in self.left(context):
            near = near_ground(context, self._in_view(viewpoint, context) & self._layers["target"])
            opens = areas[np.unique(pieces[near])].sum() if (near & reachable).any() else 0.0
            if viewpoint.gain + opens >= self.needed(viewpoint.seconds):
                return viewpoint
        return None

    def _in_view(self, viewpoint: Viewpoint, context: Context) -> NDArray[np.bool_]:
        camera = visibility.camera_view(context.frame)
        return visibility.cells_in_view(viewpoint.position, viewpoint.heading, camera, self._terrain)

    def left(self, context: Context) -> list[Viewpoint]:
        """The viewpoints that would show what is left, each what those before it do not, whatever they cost."""
        return self._in_turn(context, lambda: self._best_viewpoint(context, falls=True))

    def offers(self, context: Context, first: Viewpoint, most: int) -> list[Viewpoint]:
        """``first`` and up to ``most`` in all that are worth the drive, each for what those before it do not show."""
        return self._in_turn(context, lambda: self.next_viewpoint(context), first, most)

    def _in_turn(
        self,
        context: Context,
        best: Callable[[], Viewpoint | None],
        first: Viewpoint | None = None,
        most: int | None = None,
    ) -> list[Viewpoint]:
        """``first`` and what ``best`` then names without rewards, until nothing is left that they do not show."""
        found, target = list[Viewpoint](), self._layers["target"]
        rewards, self.rewards = self.rewards, None
        while len(found) != most and (viewpoint := first or best()):
            found.append(viewpoint)
            self._layers.write("target", self._layers["target"] & ~self._in_view(viewpoint, context))
            first = None
        self._layers.write("target", target)
        self.rewards = rewards
        return found

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember what a keyframe from this viewpoint should show."""
        newest = len(context.poses) - 1
        centres = self._layers.grid.centre_of(np.argwhere(self._in_view(viewpoint, context)))
        self._expected = Places.anchored(centres, context.poses, newest)
        ends = np.stack([context.T_map_base[:2, 3], viewpoint.position])
        self._drive = Places.anchored(ends, context.poses, newest)
        if self.rewards is not None:
            place = context.traversability.on_ground(viewpoint.position[None])[0]
            self.rewards.aim(place, viewpoint.heading)

    def worth(self, gains: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 16) scores of viewpoints, of which the greatest is chosen; not above 0 for those that show nothing.

        Args:
            gains: (N, 16) m² that each viewpoint is expected to show.
            seconds: (N, 16) s until the keyframe is taken, increased by the risk of the way.
        """
        return gains / seconds

    def needed(self, seconds: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """(N, 16) m² that viewpoints must show to be worth their time, or of one viewpoint.

        Args:
            seconds: (N, 16) s until the keyframe is taken, or of one viewpoint.
        """
        return np.asarray(self._seen * np.expm1(WORTHWHILE * np.log1p(seconds / self._duration)))

    def _narrow(self, context: Context, camera: kernels.CameraView) -> NDArray[np.int64]:
        """(N, 2) all reachable cells where the robot cannot turn around, near ground taken for level at the start.

        With its back to the wall of a small room, or on a ramp that it backed up, the robot sees ground that is
        otherwise nearer than the range of its camera.
        """
        traversability, paths = context.traversability, context.paths
        assumed = self._terrain.target & paths.reachable
        near = traversability.grid.distance_to(assumed) <= camera.reach
        return np.argwhere(paths.reachable & ~traversability.turnable & near)

    def _best_viewpoint(self, context: Context, falls: bool) -> Viewpoint | None:
        """The best viewpoint, if ground behind crests is assumed to fall or not; None if no viewpoint shows anything.

        A deck behind a crest shows from below, ground that falls does not: the robot looks for decks last.
        """
        self._falls, start = falls, context.paths.start
        if start is None:
            return None
        traversability, paths, camera = context.traversability, context.paths, visibility.camera_view(context.frame)
        cells = np.unique(np.vstack([_spread(context), self._narrow(context, camera)]), axis=0)
        candidates = np.vstack([start, traversability.grid.centre_of(cells)])
        gains = self._gains(start, cells, camera)
        if self.rewards and self.rewards.wanted:
            gains = gains + self.rewards.gains(traversability.on_ground(candidates), ANGLES)
        there = np.vstack([traversability.grid.cell_of(start), cells])
        gains = np.where(bits(paths.headings[tuple(there.T)]) & (gains >= self._strip), gains, 0.0)
        is_some = gains.any(axis=1)
        if not is_some.any():
            return None
        candidates, gains, there = candidates[is_some], gains[is_some], there[is_some]
        horizon, straight = traversability.config.costs.stop, paths.least_seconds_to(there)[:, None]
        while True:
            known = paths.seconds_to(there, horizon)
            # Ways beyond the search's horizon cost more than the horizon, and no less than a straight drive.
            beyond = np.inf if paths.is_complete else np.maximum(straight, horizon)
            least = np.where(np.isfinite(known), known, beyond)
            worth = self.worth(gains, KEYFRAME_TIME + least)
            n, m = np.unravel_index(worth.argmax(), worth.shape)
            if worth[n, m] <= 0 or (paths.is_complete and np.isinf(known[n, m])):
                return None
            if np.isfinite(known[n, m]):
                quickest = paths.without_risk.seconds_to(there[n][None], float(known[n, m]))
                seconds = KEYFRAME_TIME + float(min(quickest[0, m], known[n, m]))
                return Viewpoint(candidates[n], wrap_angle(float(ANGLES[m])), True, float(gains[n, m]), seconds)
            horizon *= 2

    def _write_ground(self, context: Context) -> None:
        """Update the layers of the ground; unseen ground that may be traversable is a target."""
        layers = self._layers
        layers.write("elevation", context.traversability.sealed)
        layers.write("gradient", context.traversability.gradient)
        layers.write("target", unseen(context))

    def _count_shown(self, context: Context) -> int:
        """Count which targets were shown; the number of the first keyframe whose misses are still to be counted."""
        known = context.poses[:0] if self._poses is None else self._poses
        first, ahead = len(known), (visibility.camera_view(context.frame).far, 0.0, 0.0, 1.0)
        moved = np.linalg.norm(((context.poses[:first] - known) @ ahead)[:, :2], axis=1).max(initial=0.0)
        if moved < self._layers.grid.cell:
            # Along the rims of what is known, also a map that moved by less covers ground without showing it.
            is_shown = ndimage.binary_opening(self._layers["target"] & ~np.isnan(context.measured), np.ones((3, 3)))
            self.posterior.shown += np.bincount(self._layers["misses"][is_shown], minlength=MOST_MISSES + 1)
            self._poses = np.concatenate([known, context.poses[first:]])
            return first
        # What was missed from corrected poses is found anew.
        self._poses, self.posterior.missed[:] = context.poses, 0
        self._layers.write("misses", np.zeros_like(self._layers["misses"]))
        self._layers.write("missed_from", np.full_like(self._layers["missed_from"], np.inf))
        return 0

    def _count_misses(self, context: Context, first: int) -> None:
        """Count which targets the keyframes from number ``first`` on should have shown, by all that is known now."""
        misses, missed_from = self._layers["misses"].copy(), self._layers["missed_from"].copy()
        terrain, poses = self._terrain._replace(missed_from=missed_from, falls=True), context.poses
        camera = visibility.camera_view(context.frame)
        visibility.count_misses(poses[first:], camera, terrain, misses, self.posterior.missed)
        self._note_disappointment(missed_from, poses)
        for cells in self._in_vain:
            if cells.keyframe[0] >= first:
                again = self._layers.grid.mask_of(cells.at(poses)) & terrain.target
                misses[again] += misses[again] < MOST_MISSES
                missed_from[again] = poses[cells.keyframe[0], :2, 3]
        self._layers.write("misses", misses)
        self._layers.write("missed_from", missed_from)

    def _note_disappointment(self, missed_from: NDArray[np.float32], poses: NDArray[np.float64]) -> None:
        """Note the cells that the last viewpoint should have shown if the drive ended there, or where it began.

        Those that the newest keyframe missed are left out: these count already. A robot that could not set out, or
        sees no more than before where it wanted to look, must turn to something else; but a keyframe from elsewhere
        tells nothing of what was to be seen.
        """
        here = poses[-1, :2, 3]
        drive = np.linalg.norm(here - self._drive.at(poses)[:, :2], axis=1)
        expected = self._layers.grid.mask_of(self._expected.at(poses)) & self._layers["target"]
        expected &= (missed_from != here.astype(np.float32)).any(axis=2)
        if (drive < ARRIVED).any() and expected.any():
            centres = self._layers.grid.centre_of(np.argwhere(expected))
            self._in_vain.append(Places.anchored(centres, poses, len(poses) - 1))
        self._expected = self._drive = NOWHERE

    @property
    def _terrain(self) -> kernels.SearchedTerrain:
        """The ground as known after the last keyframe."""
        names = ("elevation", "gradient", "target", "probability", "missed_from")
        layers = {name: self._layers[name] for name in names}
        return kernels.SearchedTerrain(self._layers.grid.origin, self._layers.grid.cell, falls=self._falls, **layers)

    def _gains(
        self, here: NDArray[np.float64], cells: NDArray[np.int64], camera: kernels.CameraView
    ) -> NDArray[np.float64]:
        """(1 + N, 16) m² that each viewpoint should show, at the place ``here`` (2,), m, and in the cells (N, 2)."""
        changed, self._revision = self._layers.changed_since(self._revision), self._layers.revision
        around = self._viewpoint_gains.of(cells, camera, self._terrain, changed)
        return np.vstack([visibility.gains(here[None], camera, self._terrain), around])


def _spread(context: Context) -> NDArray[np.int64]:
    """(N, 2) cells: of each block the one with the most reachable headings."""
    return best_of_blocks(np.bitwise_count(context.paths.headings), visibility.PLACE_STRIDE)
