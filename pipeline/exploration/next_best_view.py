"""Frontier exploration on the elevation map: the next best view."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, MaskLayer, Place, Pose, Values
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.errors import required
from pipeline.exploration import visibility
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.frontiers import cells_touching
from pipeline.exploration.sightings import Sightings
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint, Why
from pipeline.exploration.visibility_kernels import CameraView, SearchedTerrain
from pipeline.grid_map import best_of_blocks
from pipeline.planning.pose_paths import PosePaths, heading_mask
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle, yaw_of

DECK_PROBABILITY = 0.5
"""Probability that a level deck, not a falling slope, follows a crest. Nothing tells which until the robot has looked
behind the crest, and a look that shows no deck reduces the probability of the deck's cells."""


@dataclass(frozen=True, eq=False)
class RemainingGround:
    """The ground that remains to be seen after a keyframe.

    Attributes:
        terrain: the ground, the targets and their probabilities.
        camera: the camera's view of the ground.
        seen_area: area of the ground seen so far, m².
        seconds: duration of the run so far, plus the time to look around once, s.
    """

    terrain: SearchedTerrain
    camera: CameraView
    seen_area: float
    seconds: float

    def in_view(self, viewpoint: Viewpoint) -> tuple[MaskLayer, MaskLayer]:
        """The targets that a keyframe is expected to show if ground behind crests falls, and if it is level."""
        falling, decks = (
            visibility.cells_in_view(
                viewpoint.position, viewpoint.heading, self.camera, self.terrain._replace(falls=falls)
            )
            for falls in (True, False)
        )
        return falling, decks

    def after(self, viewpoint: Viewpoint) -> "RemainingGround":
        """The ground that remains after a keyframe at a viewpoint has shown all the ground expected of it."""
        falling, decks = self.in_view(viewpoint)
        target = self.terrain.target & ~falling & ~decks
        return replace(self, terrain=self.terrain._replace(target=target))


class NextBestView(Strategy):
    """Chooses the viewpoint that is expected to show the most unseen ground per second of driving.

    Attributes:
        takes_rewards: whether the rewards of a context are added to the gains.
        config: settings of exploration.
        sightings: the cells that keyframes showed and missed.
        remaining: the ground that remains to be seen; set by :meth:`observe`.
    """

    takes_rewards = True
    remaining: RemainingGround

    def __init__(self, robot: RobotModel, *, config: ExplorationConfig = ExplorationConfig()):
        """``robot``: its size and turn rate determine which viewpoints are worth a drive."""
        self.config = config
        self.sightings = Sightings(robot, config)
        self._robot = robot
        self._began: float | None = None
        # By the position, m, of a cell that may block a path: number of looks at the cell, and of drives to look.
        self._looks: Counter[tuple[float, float]] = Counter()
        self._drives: Counter[tuple[float, float]] = Counter()
        self._look: Viewpoint | None = None  # Where the robot is driving to look at such cells
        self._promised = np.zeros((0, 2)), 0.0  # centres and expected area of the last viewpoint's cells
        self._is_for_ground = False
        # Rays cast under one assumption about the ground behind crests, or for one camera, are not valid for
        # another.
        kinds = product((True, False), repeat=2)
        self._gains = {kind: visibility.ViewpointGains(config.visibility.stride) for kind in kinds}

    def observe(self, context: Context) -> None:
        """Record looks at blocking cells, the cells that new keyframes showed and missed, and the unseen ground."""
        if self._look is not None and self._is_at(self._look, context.T_map_base):
            self._looks.update(_position_keys(self._promised[0]))
        self._look = None
        camera = visibility.camera_view(context.frame, self.config.visibility)
        terrain = self.sightings.observe(context, camera)
        self._began = context.frame.time if self._began is None else self._began
        seconds = 2 * np.pi / self._robot.turn_rate + self.config.keyframe_time + context.frame.time - self._began
        seen = float(np.isfinite(context.measured).sum()) * terrain.cell**2
        self.remaining = RemainingGround(terrain, camera, seen, seconds)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that shows the most per second, or else one that may open a path; None if none is worthwhile.

        While the ground that would be given up exceeds the fraction ``max_given_up_fraction`` of the seen ground,
        every drive is worth its time.
        """
        if viewpoint := self._worthwhile_view(self.remaining, context):
            return viewpoint
        first, area = None, 0.0
        for view in self._successive_views(self._best, self.remaining, context):
            first, area = first or view, area + view.gain
            if area > self.config.max_given_up_fraction * self.remaining.seen_area:
                return first
        return None

    def leftovers(self, context: Context) -> list[Viewpoint]:
        """All ground that is given up: viewpoints that would show more, and seen ground to which no path leads.

        The viewpoints come first, whatever they cost, each for the ground that the earlier ones do not show.
        """
        return [*self._successive_views(self._best, self.remaining, context), *self._unreachable(context)]

    def worthwhile_viewpoints(self, context: Context, first: Viewpoint, limit: int) -> list[Viewpoint]:
        """At most ``limit`` viewpoints: ``first``, and others that are worth a drive.

        Each viewpoint is for ground that no earlier one shows.
        """
        return [
            first,
            *islice(self._successive_views(self._worthwhile_view, self.remaining.after(first), context), limit - 1),
        ]

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember the ground that a keyframe at this viewpoint is expected to show."""
        falling, decks = self.remaining.in_view(viewpoint)
        cells = falling | decks
        self.sightings.expect(viewpoint.position, viewpoint.heading, context)
        terrain = self.remaining.terrain
        shown = [terrain.probability[case].sum() for case in (falling, decks)]
        area = float(np.average(shown, weights=[1 - DECK_PROBABILITY, DECK_PROBABILITY])) * terrain.cell**2
        self._promised = context.traversability.grid.centre_of(np.argwhere(cells)), area
        self._is_for_ground = not viewpoint.opens
        if viewpoint.opens:
            self._look = viewpoint
            self._drives.update(_position_keys(self._promised[0]))
        if self.takes_rewards and context.rewards is not None:
            place = context.traversability.on_ground(viewpoint.position[None])[0]
            # Only a keyframe at the viewpoint earns the rewards, however early the drive has shown the ground.
            self._is_for_ground &= not context.rewards.gains(place[None], np.array([viewpoint.heading])).any()
            context.rewards.aim(place, viewpoint.heading)

    def _is_at(self, viewpoint: Viewpoint, T_map_base: Pose) -> bool:
        """Whether the robot has arrived at a viewpoint, with its heading."""
        distance = np.linalg.norm(T_map_base[:2, 3] - viewpoint.position)
        turned = abs(wrap_angle(yaw_of(T_map_base) - viewpoint.heading))
        return bool(distance <= self.config.goal_tolerance and turned <= np.pi / len(HEADING_ANGLES))

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the map already shows most of the ground that the robot set out to see."""
        places, area = self._promised
        cell = elevation_map.grid.cell
        seen = np.isfinite(elevation_map.grid.at(elevation_map.measured, places, outside=np.nan)).sum() * cell**2
        return self._is_for_ground and bool(seen >= self.config.min_shown_fraction * area)

    def scores(self, gains: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 16) scores of viewpoints, the highest of which is chosen; at most 0 for those that show nothing.

        Args:
            gains: (N, 16) m², area that each viewpoint is expected to show.
            seconds: (N, 16) s, time until the keyframe is taken, increased for the risk on the path.
        """
        return gains / seconds

    def required_gain(self, seconds: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """(N, 16) m², area that viewpoints must show to be worth the time until their keyframes.

        ``seconds``: (N, 16) time until the keyframe at each viewpoint, s. If it is a scalar, the result is a scalar,
        too.
        """
        growth = np.log(self.config.min_ground_growth) / np.log(self.config.time_growth)
        return np.asarray(self.remaining.seen_area * np.expm1(growth * np.log1p(seconds / self.remaining.seconds)))

    def _worthwhile_view(self, remaining: RemainingGround, context: Context) -> Viewpoint | None:
        """The best viewpoint that is worth the drive, or else one that may open a path.

        If no viewpoint is worth the drive, decks are then assumed to be certain, because from below a crest, a deck
        behind it is visible, but falling ground is not.
        """
        for deck_probability in (DECK_PROBABILITY, 1.0):
            best = self._best(remaining, context, deck_probability)
            if best and best.gain >= self.required_gain(best.seconds):
                return best
        return self._opening_view(remaining, context)

    def _opening_view(self, remaining: RemainingGround, context: Context) -> Viewpoint | None:
        """A viewpoint that is worth its time for the seen ground to which it may open a path; None if there is none.

        The largest unreachable pieces come first. Only unseen cells between reachable ground and the piece are
        considered, however few they are, and only if a path would lead to the piece if they were free.
        """
        terrain = remaining.terrain
        traversability = context.traversability
        # Pieces of seen ground to which no path leads, and the cells that may block the paths to them.
        pieces, areas = _unreachable_pieces(context)
        half = self.config.max_unseen_gap / 2
        bars = terrain.target & cells_touching(context, context.paths.reachable, half)
        # After too many looks or drives, cells are treated as blocked.
        often = [place for place, looks in self._looks.items() if looks >= self.config.max_looks]
        often += [place for place, drives in self._drives.items() if drives >= self.config.max_drives_to_look]
        bars &= ~traversability.grid.mask_of(np.array(often).reshape(-1, 2))
        # The largest piece for which looking at the cells that may block the path is worth the time.
        context = replace(context, rewards=None)
        for piece in np.argsort(-areas):
            if areas[piece] < self.required_gain(self.config.keyframe_time):
                return None
            barred = bars & cells_touching(context, pieces == piece, half)
            viewpoint = self._view_of_bars(barred, remaining, context)
            if viewpoint is None:
                continue
            opened = terrain.probability[barred].max() * areas[piece]
            if viewpoint.gain + opened >= self.required_gain(viewpoint.seconds) and self._may_open(
                pieces == piece, context
            ):
                return replace(viewpoint, opens=True, stands=True)
        return None

    def _view_of_bars(self, bars: MaskLayer, remaining: RemainingGround, context: Context) -> Viewpoint | None:
        """The best view of the cells that may block a path; None if no view shows any of them.

        A cell that stays unseen still blocks the path, so only views that show almost as many cells as the best one
        are considered. Views that do so even if the robot arrives closer than planned are preferred, because the
        camera cannot see the ground right in front of the robot.
        """
        remaining = replace(remaining, terrain=remaining.terrain._replace(target=bars))
        farther = visibility.without_nearest(remaining.camera, self.config.visibility.max_overshoot)
        for camera in (farther, remaining.camera):
            if view := self._best(
                replace(remaining, camera=camera), context, min_gain=0.0, min_fraction=self.config.min_shown_fraction
            ):
                return view
        return None

    def _may_open(self, piece: MaskLayer, context: Context) -> bool:
        """Whether a path leads to a piece of seen ground if the unseen gaps between it and reachable ground are free.

        Unseen cells next to hazards are no targets, but a view of the targets in a gap shows them as well.
        """
        ground = context.traversability
        paths = context.paths
        beyond = self.config.max_unseen_gap
        gaps = np.isnan(context.measured) & cells_touching(context, paths.reachable, beyond)
        gaps &= cells_touching(context, piece, beyond)
        shut = ground.grid.centre_of(np.argwhere((ground.obstacle != 0) & ~gaps))
        opened = ground.with_unseen_free(np.zeros((0, 2)), 0.0, shut, doubts=False)
        return bool((PosePaths(opened, required(paths.start), paths.heading).reachable & piece).any())

    def _unreachable(self, context: Context) -> Iterator[Viewpoint]:
        """The pieces of seen ground to which no path leads, the largest first, as viewpoints that are given up."""
        traversability = context.traversability
        pieces, areas = _unreachable_pieces(context)
        half = self.config.max_unseen_gap / 2
        near = cells_touching(context, context.paths.reachable, half)
        is_known = np.isfinite(traversability.elevation)
        steep = np.linalg.norm(traversability.gradient, axis=-1) > np.tan(traversability.robot.max_tilt)
        target = self.remaining.terrain.target
        with_unseen = _connected_to_reachable(context, is_known & ~traversability.hazard | target)
        with_slopes = _connected_to_reachable(context, is_known & (steep | ~traversability.hazard))
        without = _connected_to_reachable(context, is_known & ~traversability.hazard)
        for piece in np.argsort(-areas):
            if areas[piece] < self.config.min_unreachable_area:
                return
            cells = pieces == piece
            between = near & cells_touching(context, cells, half)
            why: Why = "no_way"
            if (between & target & with_unseen).any():
                why = "unseen"
            elif (between & traversability.kept_off).any():
                why = "person"
            elif (cells & with_slopes).any() and not (cells & without).any():
                why = "too_steep"
            places = traversability.grid.centre_of(np.argwhere(cells))
            middle = places[np.linalg.norm(places - places.mean(axis=0), axis=1).argmin()]
            yield Viewpoint(middle, 0.0, turn=False, gain=float(areas[piece]), seconds=np.inf, why=why)

    def _successive_views(
        self,
        best: Callable[[RemainingGround, Context], Viewpoint | None],
        remaining: RemainingGround,
        context: Context,
    ) -> Iterator[Viewpoint]:
        """The viewpoints that ``best`` returns in turn, without rewards.

        Each viewpoint is for ground that no earlier one shows.
        """
        context = replace(context, rewards=None)
        while viewpoint := best(remaining, context):
            yield viewpoint
            remaining = remaining.after(viewpoint)

    def _best(
        self,
        remaining: RemainingGround,
        context: Context,
        deck_probability: float = DECK_PROBABILITY,
        min_gain: float | None = None,
        min_fraction: float = 0.0,
    ) -> Viewpoint | None:
        """The viewpoint with the highest score; None if none shows anything, or if no path leads to one that does.

        Args:
            remaining: the ground that remains to be seen.
            context: the context of the decision.
            deck_probability: probability that a level deck, not a falling slope, follows a crest.
            min_gain: minimum gain, m²; by default, the area of a row of cells as long as the robot is wide.
            min_fraction: minimum fraction of the highest gain of any viewpoint.
        """
        paths = context.paths
        grid = context.traversability.grid
        terrain = remaining.terrain
        if paths.start is None:
            return None
        # Candidates: the robot's position, and cells all over the reachable ground.
        spread = self._candidates(remaining, context)
        places = np.vstack([paths.start, grid.centre_of(spread)])
        cells = np.vstack([grid.cell_of(paths.start), spread])
        # Gains: unseen ground in view and rewards, where their sum is large enough and the robot can stand.
        falling = self._ground_in_view(places[0], spread, remaining, falls=True)
        decks = self._ground_in_view(places[0], spread, remaining, falls=False)
        gains = (1 - deck_probability) * falling + deck_probability * decks
        rewards = np.zeros_like(gains)
        if self.takes_rewards and context.rewards and context.rewards.wanted:
            rewards = context.rewards.gains(context.traversability.on_ground(places), HEADING_ANGLES)
        gains = gains + rewards
        min_gain = self._robot.width * terrain.cell if min_gain is None else min_gain
        gains = np.where(heading_mask(paths.headings[tuple(cells.T)]) & (gains >= min_gain), gains, 0.0)
        gains[gains < min_fraction * gains.max()] = 0.0
        is_some = gains.any(axis=1)
        if not is_some.any():
            return None
        places = places[is_some]
        cells = cells[is_some]
        gains = gains[is_some]
        is_rewarded = rewards[is_some] > 0
        # Scores: gain per second. The search for paths extends no farther than the best viewpoint requires, because
        # viewpoints beyond its horizon take longer than the horizon, and no less than a straight drive.
        straight = paths.min_seconds_to(cells)[:, None]
        horizon = self.config.horizon
        while True:
            found = paths.seconds_to(cells, horizon)
            beyond = np.inf if paths.is_complete else np.maximum(straight, horizon)
            seconds = np.where(np.isfinite(found), found, beyond)
            scores = self.scores(gains, self.config.keyframe_time + seconds)
            n, m = np.unravel_index(scores.argmax(), scores.shape)
            if scores[n, m] <= 0 or (paths.is_complete and np.isinf(found[n, m])):
                return None
            if np.isfinite(found[n, m]):
                break
            horizon *= 2
        # Scores include the risk on the path as time; the time of the viewpoint itself does not.
        quickest = paths.without_risk.seconds_to(cells[n][None], float(found[n, m]))[0, m]
        drive = float(min(quickest, found[n, m]))
        heading = wrap_angle(float(HEADING_ANGLES[m]))
        gain = float(gains[n, m])
        duration = self.config.keyframe_time + drive
        return Viewpoint(places[n], heading, True, gain, duration, stands=bool(is_rewarded[n, m]))

    def _ground_in_view(
        self, here: Place, spread: Cells, remaining: RemainingGround, *, falls: bool
    ) -> NDArray[np.float64]:
        """(1 + N, 16) m², ground that viewpoints at a position (2,) and in cells (N, 2) are expected to show.

        ``falls``: whether unknown ground behind crests is assumed to fall.
        """
        camera = remaining.camera
        terrain = remaining.terrain._replace(falls=falls)
        gains = self._gains[falls, camera == self.remaining.camera].at(spread, camera, terrain)
        return np.vstack([visibility.gains(here[None], camera, terrain), gains])

    def _candidates(self, remaining: RemainingGround, context: Context) -> Cells:
        """(N, 2) cells: in each block, the one with the most reachable headings, and those where no full turn fits.

        The latter are close to ground that was assumed, not seen, at the start. With its back to the wall of a small
        room, or after backing up a ramp, the robot sees ground that is otherwise too close to its camera.
        """
        traversability = context.traversability
        paths = context.paths
        spread = best_of_blocks(np.bitwise_count(paths.headings), self.config.visibility.stride)
        assumed = remaining.terrain.target & paths.reachable
        near = traversability.grid.distance_to(assumed) <= remaining.camera.reach
        is_one = paths.reachable & ~traversability.turnable & near
        is_one[tuple(spread.T)] = True
        return np.argwhere(is_one)


def _unreachable_pieces(context: Context) -> tuple[NDArray[np.int32], Values]:
    """(nx, ny) numbers of the pieces of seen ground to which no path leads, and the areas of the pieces, m².

    The number is 0 in cells that belong to no piece.
    """
    ground = context.traversability
    pieces, _ = ndimage.label(ground.traversable & ~context.paths.reachable, np.ones((3, 3)))
    areas = np.bincount(pieces.ravel()).astype(np.float64) * ground.grid.cell**2
    areas[0] = 0.0  # no piece
    return pieces, areas


def _connected_to_reachable(context: Context, ground: MaskLayer) -> MaskLayer:
    """The pieces of a mask ``ground`` that contain reachable cells."""
    pieces, _ = ndimage.label(ground, np.ones((3, 3)))
    return np.isin(pieces, np.unique(pieces[context.paths.reachable])) & (pieces > 0)


def _position_keys(places: NDArray[np.float64]) -> list[tuple[float, float]]:
    """The positions of cells (N, 2), m, as keys."""
    return [(float(x), float(y)) for x, y in places.round(2)]
