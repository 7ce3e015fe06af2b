"""Planning time per step on completely mapped floors, stage by stage, for a small floor and a large one.

In each step, a keyframe at a random place adds a new box and measures the ground in view with noise. The processor
time of one thread is measured, so that other load on the machine has no effect.
"""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places, Pose
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import TraversabilityLayer
from pipeline.exploration.frontiers import find_frontiers
from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Context
from pipeline.planning.path_plan import plan_path
from pipeline.planning.pose_paths import PosePaths
from pipeline.segments.segments import Segments
from pipeline.sensor import XTION
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.transforms import from_yaw, yaw_of
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import tracked
from sarsim.ground_truth.true_surface import Survey
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.settings import ARENAS, PlanningSettings

WARM_UP = 2  # Number of first steps, whose times are discarded
GROUND_NOISE = 0.003  # m, standard deviation of heights from keyframe to keyframe
HALF_VIEW = np.deg2rad(29)  # Half the camera's horizontal field of view
HITS_PER_CELL = 9  # Returns per cell in a keyframe
WALL_HEIGHTS = np.arange(0, 1.01, 0.1)  # m, heights of the points of walls and of the new box
BOX_DISTANCE, BOX_SIDE = 1.3, 0.3  # m, distance and side of the new box


def measure(settings: PlanningSettings) -> Result:
    """Median times of a step and of its stages in each arena, ms."""
    check_at_least(1, settings, "steps")
    check_at_least(0, settings, "seed")
    figures: dict[str, float] = {}
    for arena in ARENAS:
        seconds = _Floor(arena, settings.seed).steps(settings.steps)
        figures[f"{arena}.step_ms"] = 1e3 * float(np.median(np.sum(list(seconds.values()), axis=0)))
        figures |= {f"{arena}.{stage}_ms": 1e3 * float(np.median(times)) for stage, times in seconds.items()}
    figures["large_over_small"] = figures[f"{ARENAS[-1]}.step_ms"] / figures[f"{ARENAS[0]}.step_ms"]
    return Result(figures)


class _Floor:
    """The maps used for planning, filled from the true ground of an arena."""

    def __init__(self, arena: str, seed: int):
        robot = SimulatedRobot(load_arena(arena), SimulationConfig(), seed)
        self._frame, model, physics = robot.sense(), robot.model, robot.physics
        self._start = robot.trajectory[-1].T_world_base
        survey = Survey(physics.model.ptr, physics.data.ptr, robot.base_body, model)
        surface = survey.surface_from(self._start[:3, 3])
        robot.close()
        cells = np.argwhere(~np.isnan(surface.height))
        self._ground = np.column_stack([surface.grid.centre_of(cells), surface.height[tuple(cells.T)]])
        walls = np.repeat(surface.grid.centre_of(np.argwhere(surface.walls)), len(WALL_HEIGHTS), axis=0)
        tops = np.resize(WALL_HEIGHTS, len(walls)) + self._start[2, 3]
        self._elevation_map, self._rng = ElevationMap(model), np.random.default_rng(seed)
        self._add_returns(np.vstack([self._ground, np.column_stack([walls, tops])]))
        self._layer, self._topology = TraversabilityLayer(), TopologicalMap()
        self._exploration = NextBestView(model)

    def steps(self, count: int) -> dict[str, list[float]]:
        """Seconds of each stage in each of ``count`` steps, at random places on the floor."""
        seconds: dict[str, list[float]] = defaultdict(list)
        self._step(self._start, defaultdict(list))
        for place in tracked(self._places(count + WARM_UP), "planning"):
            x, y = place
            T_map_base = from_yaw(x, y, self._start[2, 3], self._rng.uniform(-np.pi, np.pi))
            self._add_view(T_map_base)
            self._step(T_map_base, seconds)
        return {stage: times[WARM_UP:] for stage, times in seconds.items()}

    def _places(self, count: int) -> Places:
        """Random places that the robot can reach and where it can turn."""
        paths = PosePaths(self._layer.update(self._elevation_map), self._start[:2, 3], yaw_of(self._start))
        cells = np.argwhere(paths.reachable & paths.traversability.turnable)
        return paths.traversability.grid.centre_of(self._rng.choice(cells, count))

    def _add_view(self, T_map_base: Pose) -> None:
        """Add returns of the ground in view, and of a new box on it, to the elevation map."""
        ahead = (self._ground[:, :2] - T_map_base[:2, 3]) @ T_map_base[:2, :2]
        away = np.hypot(*ahead.T)
        in_view = (away > XTION.nearest) & (away < XTION.farthest) & (np.abs(np.arctan2(*ahead.T[::-1])) < HALF_VIEW)
        is_box = np.abs(ahead - (BOX_DISTANCE, 0)).max(axis=1) < BOX_SIDE / 2
        box = np.vstack([self._ground[is_box] + (0, 0, z) for z in WALL_HEIGHTS])
        seen = self._ground[in_view] + self._rng.normal(0, [0, 0, GROUND_NOISE], (in_view.sum(), 3))
        self._add_returns(np.vstack([seen, box]))

    def _add_returns(self, points: NDArray[np.float64]) -> None:
        """Add ``HITS_PER_CELL`` returns at each of (N, 3) points to the elevation map."""
        self._elevation_map.update(points.astype(np.float32), hits=np.full(len(points), HITS_PER_CELL, np.uint32))

    def _step(self, T_map_base: Pose, seconds: dict[str, list[float]]) -> None:
        """Do the explorer's work between two drives, and time its stages."""
        with _timed(seconds["traversability"]):
            traversability = self._layer.update(self._elevation_map)
        with _timed(seconds["reachable"]):
            paths = PosePaths(traversability, T_map_base[:2, 3], yaw_of(T_map_base))
            context = Context(self._frame, T_map_base, self._elevation_map.measured, paths, T_map_base[None])
        with _timed(seconds["next_view"]):
            self._exploration.observe(context)
            viewpoint = self._exploration.next_viewpoint(context)
            find_frontiers(context)
        with _timed(seconds["topology"]):
            self._topology.update([], Segments(), paths)
        with _timed(seconds["way"]):
            if viewpoint is not None:
                plan_path(self._topology, paths, viewpoint.position, viewpoint.heading)


@contextmanager
def _timed(seconds: list[float]) -> Iterator[None]:
    start = time.thread_time()
    yield
    seconds.append(time.thread_time() - start)
