"""Paths to goals on the assumption that unseen ground is free (Koenig & Likhachev 2002), and views of this ground."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Cells, MaskLayer, Place
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES, HEADINGS, ORIENTATIONS, UNKNOWN, footprint_distances
from pipeline.elevation_map.traversability import Traversability
from pipeline.errors import required
from pipeline.exploration import visibility
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.sightings import Sightings
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.exploration.visibility_kernels import CameraView, SearchedTerrain
from pipeline.grid_map import best_of_blocks
from pipeline.keyframes import AnchoredPlaces
from pipeline.planning.path_plan import goal_name
from pipeline.planning.pose_paths import PosePaths, heading_mask, nearest_heading
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle

NO_PLACES = np.zeros((0, 2))


@dataclass(frozen=True, eq=False)
class PathView(Viewpoint):
    """A view of unseen ground on a path to a goal.

    Attributes:
        shown_places: (N, 2) m, centres of the cells that the view is expected to show.
    """

    shown_places: NDArray[np.float64] = field(default_factory=lambda: NO_PLACES)


@dataclass(frozen=True, eq=False)
class GoalSearch:
    """The cheapest paths to a goal from all poses.

    Attributes:
        ground: the ground, on a grid that may be larger than the map's.
        goal: (2,) m, position of the goal in ``map``.
        caution: see :class:`PosePaths`.
    """

    ground: Traversability
    goal: Place
    caution: float

    @cached_property
    def _paths(self) -> PosePaths:
        """Paths from the goal; in reverse, with opposite headings, they lead to the goal at the same cost."""
        return PosePaths(self.ground, self.goal, caution=self.caution)

    def seconds_from(self, places: NDArray[np.float64], until: float = np.inf) -> NDArray[np.float32]:
        """(N, 16) s, costs to the goal from places (N, 2), m, with each heading; costs above ``until`` may be inf."""
        seconds = self._paths.seconds_to(self.ground.grid.cell_of(places), until)
        return np.roll(seconds, ORIENTATIONS, axis=1)

    def seconds_from_pose(self, xy: Place, heading: int) -> float:
        """Cost, s, of the path from a position (2,) and the index of a heading to the goal; inf if there is none."""
        return self._paths.seconds_at(xy, (heading + ORIENTATIONS) % HEADINGS)

    def states_from(self, xy: Place, heading: int) -> Cells:
        """(N, 3) cells of ``ground`` and indices of headings on the path to the goal, which must exist.

        ``xy`` (2,), m, and the index ``heading`` are the pose at which the path starts.
        """
        states = self._paths.states_to(xy, (heading + ORIENTATIONS) % HEADINGS)[::-1]
        return np.column_stack([states[:, :2], (states[:, 2] + ORIENTATIONS) % HEADINGS])


class Gap(NamedTuple):
    """The unseen ground that a path to a goal meets first.

    Attributes:
        hidden: the unseen cells that keep the robot from following the path.
        path_before: (N, 3) cells of the map and indices of headings on the path before the gap.
        seconds: time of the entire path to the goal, s.
    """

    hidden: MaskLayer
    path_before: Cells
    seconds: float


class UnseenGroundSearch:
    """Finds views of the unseen ground that the cheapest path to a goal meets first if all unseen ground is free.

    Ground that several views failed to show is treated as blocked.
    """

    def __init__(self, robot: RobotModel, config: ExplorationConfig):
        self._config = config
        self._numbers = config.unseen_ways
        self._sightings = Sightings(robot, config)
        self._terrain: SearchedTerrain
        self._camera: CameraView
        self._promised = NO_PLACES  # centres of the cells expected in the last view, m
        self._aimed: list[AnchoredPlaces] = []  # the same for each view so far, anchored

    def observe(self, context: Context) -> None:
        """Record the cells that keyframes showed and missed."""
        self._camera = visibility.camera_view(context.frame, self._config.visibility)
        self._terrain = self._sightings.observe(context, self._camera)

    def ground_towards(self, goals: NDArray[np.float64], context: Context, doubts: bool = True) -> Traversability:
        """The ground if unseen ground is free, on a grid that contains goals (N, 2), m.

        Goals on unseen ground must not be far, see :meth:`is_far`. ``doubts``: whether ground that views failed to
        show, or where a thin panel may stand, is not free.
        """
        shut = self._blocked_places(context) if doubts else NO_PLACES
        return context.traversability.with_unseen_free(goals, self._numbers.margin, shut, doubts)

    def is_far(self, goal: Place, context: Context) -> bool:
        """Whether a goal is too far away for a search through unseen ground."""
        return not np.linalg.norm(goal - context.T_map_base[:2, 3]) <= self._numbers.farthest

    def unreachable_reason(self, goal: Place, context: Context) -> str | None:
        """The reason why no path leads to a goal through unseen ground, as a line for the log.

        None if unseen ground is not the cause.
        """
        ground = context.traversability
        if not np.isfinite(goal).all() or context.paths.start is None:
            return None
        if self.is_far(goal, context):
            away = np.linalg.norm(goal - context.T_map_base[:2, 3])
            most = self._numbers.farthest
            return f"{goal_name(goal)} is {away:.1f} m away; paths through unseen ground are limited to {most:g} m"
        is_seen = np.isfinite(ground.grid.at(ground.elevation, goal, outside=np.nan))
        if is_seen or ground.grid.at(ground.to_hazard, goal, outside=np.inf) < ground.robot.half_width:
            return None
        return f"{goal_name(goal)} cannot be reached: every path is blocked, and the ground at the goal was not seen"

    def may_open(self, goal: Place, context: Context) -> bool:
        """Whether a path leads to a goal if only hazards that were seen can block paths."""
        start = context.paths.start
        if start is None or self.is_far(goal, context):
            return False
        ground = self.ground_towards(goal[None], context, doubts=False)
        return bool(np.isfinite(PosePaths(ground, start, context.paths.heading).cost_to(goal)))

    def view_towards(self, goal: Place, context: Context) -> PathView | None:
        """The view via which the robot reaches a goal soonest; None if no path, or nothing to look at, is left."""
        if context.paths.start is None or self.is_far(goal, context):
            return None
        # Ground that keyframes missed is weighted by the probability that it is shown; if this yields no view, by 1.
        anyhow = np.ones_like(self._terrain.probability)
        for terrain in (self._terrain, self._terrain._replace(probability=anyhow)):
            if (view := self._best_over_paths(terrain, goal, context)) is not None:
                return view
        return None

    def _best_over_paths(self, terrain: SearchedTerrain, goal: Place, context: Context) -> PathView | None:
        """The best of the views for a few paths through different unseen ground."""
        shut = self._blocked_places(context)
        views = list[tuple[float, PathView]]()
        while len(views) < self._numbers.alternatives:
            # The cheapest path if unseen ground is free, and the unseen ground that it meets first.
            ground = context.traversability.with_unseen_free(goal[None], self._numbers.margin, shut)
            search = GoalSearch(ground, goal, context.paths.caution)
            gap = self._first_gap(search, context) if ground.grid.at(ground.traversable, goal) else None
            if gap is None or gap.seconds >= min((seconds for seconds, _ in views), default=np.inf):
                break
            # The best view of this ground. From below a crest, a deck behind it is visible, but falling ground is
            # not, so decks are assumed last.
            for falls, within in product((True, False), (self._numbers.detour, np.inf)):
                searched = terrain._replace(target=gap.hidden, falls=falls)
                if (best := self._best_view(gap, search, context, searched, within)) is not None:
                    views.append(best)
                    break
            # Another path may need no look, or a quicker one. If no view shows this ground, the path must avoid it.
            shut = np.vstack([shut, context.traversability.grid.centre_of(np.argwhere(gap.hidden))])
        return min(views, key=lambda found: found[0])[1] if views else None

    def commit(self, view: PathView, context: Context) -> None:
        """Remember the ground that a view returned by :meth:`view_towards` is expected to show."""
        self._promised = view.shown_places
        self._aimed.append(AnchoredPlaces.anchored(view.shown_places, context.poses, len(context.poses) - 1))
        self._sightings.expect(view.position, view.heading, context)

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the map already shows most of the ground that the last view is expected to show."""
        seen = np.isfinite(elevation_map.grid.at(elevation_map.elevation, self._promised, outside=np.nan))
        return bool(seen.sum() >= self._config.min_shown_fraction * len(seen))

    def _blocked_places(self, context: Context) -> NDArray[np.float64]:
        """(N, 2) m, centres of the cells that are still unknown after ``tries`` keyframes or ``drives`` drives."""
        ground = context.traversability
        aims = sum((ground.grid.mask_of(p.at(context.poses)) for p in self._aimed), np.zeros(ground.grid.shape, int))
        is_shut = (self._sightings.misses >= self._numbers.tries) | (aims >= self._numbers.drives)
        return ground.grid.centre_of(np.argwhere(is_shut & np.isnan(ground.elevation)))

    def _first_gap(self, search: GoalSearch, context: Context) -> Gap | None:
        """The first gap on the path from the robot's position; None if there is no path, or no gap."""
        start = self._start_pose(search, context)
        if start is None:
            return None
        t = context.traversability
        states = search.states_from(*start)
        states[:, :2] += search.ground.grid.low - t.grid.low
        first = self._known_count(states, search, context)
        if first == len(states):
            return None
        metres = t.grid.cell * np.linalg.norm(np.diff(states[first:, :2], axis=0), axis=1).cumsum()
        last = first + 1 + int((metres <= self._numbers.view_length).sum())
        hidden = _unknown_around(states[max(first - 1, 0) : last], t)
        return Gap(hidden, states[:first], search.seconds_from_pose(*start)) if hidden.any() else None

    def _known_count(self, states: Cells, search: GoalSearch, context: Context) -> int:
        """The number of poses on a path before the first gap; ``states``: (N, 3) cells of the map and headings.

        Unseen ground is not a gap if a detour around it takes less time than a look at it.
        """
        paths = context.paths
        can_reach = paths.can_reach(states)
        known = np.flatnonzero(can_reach)
        if not len(known):
            return 0
        rows = np.arange(len(known))
        cells = states[can_reach, :2]
        heading = states[can_reach, 2]
        places = context.traversability.grid.centre_of(cells)
        left = search.seconds_from(places)[rows, heading]
        until = paths.seconds_at(places[0], int(heading[0])) + float(np.ptp(left)) + self._numbers.second_look_cost
        detour = paths.seconds_to(cells, until)[rows, heading] + left - left[0]
        near = known[detour <= detour[0] + self._numbers.second_look_cost]
        return int(near.max()) + 1

    def _start_pose(self, search: GoalSearch, context: Context) -> tuple[Place, int] | None:
        """The start of the path: the robot's pose or, if it lacks room there, a reachable pose; None if neither."""
        paths = context.paths
        grid = context.traversability.grid
        start = required(paths.start)
        headings = range(HEADINGS) if paths.heading is None else [nearest_heading(paths.heading)]
        seconds = [search.seconds_from_pose(start, heading) for heading in headings]
        if np.isfinite(min(seconds)):
            return start, headings[int(np.argmin(seconds))]
        cells = best_of_blocks(np.bitwise_count(paths.headings), self._config.visibility.stride)
        places = grid.centre_of(cells)
        can_stand = heading_mask(paths.headings[tuple(cells.T)])
        total = np.where(can_stand, paths.seconds_to(cells) + search.seconds_from(places), np.inf)
        if not np.isfinite(total).any():
            return None
        n, heading = np.unravel_index(total.argmin(), total.shape)
        return places[n], int(heading)

    def _best_view(
        self, gap: Gap, search: GoalSearch, context: Context, terrain: SearchedTerrain, within: float
    ) -> tuple[float, PathView] | None:
        """The cost and the view via which the robot reaches the goal soonest; None if no view shows enough of a gap.

        Args:
            gap: the unseen ground.
            search: the paths to the goal.
            context: the context of the decision.
            terrain: the ground, with the gap as its target.
            within: maximum delay compared with a drive to the goal without a look, s.

        Returns:
            The time to the goal via the view, including the expected cost of another look, s; and the view.
        """
        t = context.traversability
        paths = context.paths
        # Candidates show enough of the gap, and the robot can stand there.
        cells = self._candidates(gap, context)
        places = t.grid.centre_of(cells)
        shares = visibility.gains(places, self._camera, terrain) / (gap.hidden.sum() * t.grid.cell**2)
        shares = np.where(heading_mask(paths.headings[tuple(cells.T)]), np.minimum(shares, 1.0), 0.0)
        some = (shares >= self._numbers.min_fraction).any(axis=1)
        cells = cells[some]
        places = places[some]
        shares = shares[some]
        # Their cost is the time to the goal via the view, plus the time of a second look at the ground that the view
        # does not show.
        left = search.seconds_from(places, gap.seconds + within)
        if not np.isfinite(left).any():
            return None
        there = paths.seconds_to(cells, float(gap.seconds + within - left.min()))
        cost = there + left + self._numbers.second_look_cost * (1 - shares)
        cost[shares < self._numbers.min_fraction] = np.inf
        n, m = np.unravel_index(cost.argmin(), cost.shape)
        if np.isinf(cost[n, m]):
            return None
        heading = wrap_angle(float(HEADING_ANGLES[m]))
        shown = visibility.cells_in_view(places[n], heading, self._camera, terrain)
        # The cost of the drive includes the risk on the path as time; the time of the view itself does not.
        quickest = paths.without_risk.seconds_to(cells[n][None], float(there[n, m]))[0, m]
        seconds = self._config.keyframe_time + float(min(quickest, there[n, m]))
        gain = float(shown.sum()) * t.grid.cell**2
        shown_places = t.grid.centre_of(np.argwhere(shown))
        view = PathView(places[n], heading, True, gain, seconds, stands=True, shown_places=shown_places)
        return float(cost[n, m]), view

    def _candidates(self, gap: Gap, context: Context) -> Cells:
        """(N, 2) cells from which a gap may be in view: a sample of those around it, and all on the path to it."""
        t = context.traversability
        cells = best_of_blocks(np.bitwise_count(context.paths.headings), self._config.visibility.stride)
        cells = np.unique(np.vstack([cells, gap.path_before[:, :2]]), axis=0)
        hidden = t.grid.centre_of(np.argwhere(gap.hidden))
        low = hidden.min(axis=0) - self._camera.reach
        high = hidden.max(axis=0) + self._camera.reach
        places = t.grid.centre_of(cells)
        return cells[((places >= low) & (places <= high)).all(axis=1)]


def _unknown_around(states: Cells, t: Traversability) -> MaskLayer:
    """The unknown cells that block a path, except those that block only its first pose.

    ``states``: (N, 3) cells and headings of the poses on the path.
    """
    size = t.robot.half_length, t.robot.half_width
    offsets, distances, _ = footprint_distances(*size, t.grid.cell, t.config.costs.full_speed_clearance)
    is_near = distances + 100 * t.config.leniency < t.required_clearance.max()
    hidden = np.zeros(t.grid.shape, np.bool_)
    for (i, j, h), (a, b, k) in pairwise(states.tolist()):
        near = is_near[:, k % ORIENTATIONS]
        if (i, j) == (a, b):
            turn = h if (k - h) % HEADINGS == 1 else k
            near = near | is_near[:, ORIENTATIONS + turn % ORIENTATIONS]
        cells = offsets[near] + (a, b)
        hidden[tuple(cells[t.grid.holds(cells)].T)] = True
    return hidden & (t.obstacle == UNKNOWN)
