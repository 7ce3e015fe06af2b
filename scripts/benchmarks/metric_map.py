"""The metric map compared with exact ray traversal and OctoMap, on the same recorded frames.

Each method uses one thread, whose processor time is measured, so that other load on the machine has no effect.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pyoctomap
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.errors import required
from pipeline.explorer import Explorer
from pipeline.frame import Intrinsics
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import Motion
from pipeline.run import explore
from pipeline.sink import Sink
from pipeline.transforms import transform_places
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import progress, tracked
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.scoring.voxels import VoxelScore
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.settings import ARENAS, MetricMapSettings

SMALL, LARGE = (6.0, 4.0), (520.0, 150.0)
SIZES = (SMALL, (20.0, 15.0), (52.0, 15.0), (130.0, 60.0), LARGE)
"""Sizes of the environments in which frame times are compared, m."""
TILE_FRAMES = 8  # Frames that map each 6 m × 4 m tile of an environment before timing starts
WARM_UP = 5  # Number of frames that are added untimed before the measurement
MAX_STEPS = 160  # Maximum number of steps of an episode


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """N frames of an episode.

    Attributes:
        intrinsics: intrinsics of all depth images.
        ideal: (N, H, W) float32 noise-free depth, m, where the sensor's range and angles allow a return.
        xtion: (N, H, W) float32 depth with the Xtion's noise, m.
        T_map_camera: (N, 4, 4) true poses of ``camera_optical``.
    """

    intrinsics: Intrinsics
    ideal: NDArray[np.float32]
    xtion: NDArray[np.float32]
    T_map_camera: Poses

    def points(self, depth: NDArray[np.float32], n: int) -> NDArray[np.float64]:
        """(M, 3) returns of image ``n`` of a sensor's ``depth`` (N, H, W), in ``map``, m."""
        T = self.T_map_camera[n]
        returns = depth[n] > 0
        rays = self.intrinsics.rays[returns].astype(np.float64)
        return transform_places(T, rays * depth[n][returns, None])


def record(arena: str, seed: int, frames: int) -> RecordedFrames:
    """Let the robot explore for an episode, and keep frames evenly spaced in time.

    Raises:
        InputError: the arena cannot be loaded.
    """
    robot = SimulatedRobot(load_arena(arena), SimulationConfig(), seed)
    explorer = Explorer(robot, make_mapper(TRUE_LABELS, robot.model, seed))
    album = _FrameRecorder(robot, frames)
    explorer.watch(album)
    with progress(transient=True) as bars:
        bar = bars.add_task(f"steps of a recording in {arena}", total=None)
        explore(explorer, may_step=lambda: explorer.steps < MAX_STEPS, on_done=lambda: bars.advance(bar))
    intrinsics = robot.sense().intrinsics
    robot.close()
    ideal, xtion, poses = (np.array(column) for column in zip(*album.chosen(), strict=True))
    return RecordedFrames(intrinsics, ideal, xtion, poses)


class _FrameRecorder(Sink):
    """Takes frames at regular intervals; at twice the wanted number, drops half of them and doubles the interval."""

    def __init__(self, robot: SimulatedRobot, wanted: int):
        self._robot, self._wanted = robot, wanted
        self._period, self._next = 1.0, robot.time
        self._frames: list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]] = []

    def on_motion(self, motion: Motion) -> None:
        """Take a frame if one is due."""
        if motion.time < self._next:
            return
        self._next += self._period
        depth = self._robot.sense().depth
        truth = required(self._robot.true_frame)
        self._frames.append((truth.image.depth, depth, truth.image.T_world_camera))
        if len(self._frames) == 2 * self._wanted:
            del self._frames[1::2]
            self._period *= 2

    def chosen(self) -> list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]]:
        """The wanted number of evenly spaced frames, or all if there are fewer."""
        places = np.linspace(0, len(self._frames) - 1, min(self._wanted, len(self._frames)))
        return [self._frames[n] for n in np.rint(places).astype(int)]


def measure(settings: MetricMapSettings) -> Result:
    """Times, memory and accuracy of all contenders, and our times by size of the environment.

    Raises:
        InputError: pyoctomap is missing, or there is nothing to measure.
    """
    check_at_least(1, settings, "frames")
    check_at_least(0, settings, "seed")
    first, *others = ARENAS
    # Set up the frames of a drive, which are the same for every contender.
    recording = record(first, settings.seed, settings.frames)
    # Time and memory of all contenders, and times in larger environments.
    figures, sizes = _speed(recording), _sizes(recording)
    figures["large_over_small"] = sizes[-1]["over_small"]
    # Accuracy in this arena and in the others.
    figures |= _accuracy(recording)
    for arena in others:
        accuracy = _accuracy(record(arena, settings.seed, settings.frames))
        figures |= {f"{arena}.{name}": value for name, value in accuracy.items()}
    return Result(figures, {"sizes": sizes})


def _speed(recording: RecordedFrames) -> dict[str, float]:
    """Milliseconds per frame and bytes of each contender, and ratios of times."""
    contenders: dict[str, Callable[[], Contender]] = {
        "ours": lambda: Projective(0.1),
        "ours_5cm": lambda: Projective(0.05),
        "rays": lambda: Rays(0.1),
        "octomap_discretized": lambda: OctoMap(0.1, discretize=True),
        "octomap_discretized_5cm": lambda: OctoMap(0.05, discretize=True),
        "octomap": lambda: OctoMap(0.1, discretize=False),
    }
    times, figures = {}, {}
    for name, make in contenders.items():
        contender = make()
        times[name] = _frame_times(contender, recording, name)
        figures[f"{name}.frame_ms"] = 1e3 * float(np.median(times[name]))
        figures[f"{name}.bytes"] = float(contender.nbytes)
    for name in times:
        if name.startswith("octomap"):
            ours = times["ours_5cm" if name.endswith("5cm") else "ours"]
            figures[f"frame_vs_{name}"] = float(np.median(times[name]) / np.median(ours))
    figures["reading.frame_ms"] = 1e3 * float(np.median([_timed(depth.max) for depth in recording.xtion]))
    return figures


def _frame_times(contender: "Contender", recording: RecordedFrames, name: str) -> NDArray[np.float64]:
    """Seconds of each frame; some frames are added beforehand without timing, so that numba's kernels are ready."""
    depth = recording.xtion
    for n in range(WARM_UP):
        contender.prepare(recording, depth, n % len(depth))()
    return np.array([_timed(contender.prepare(recording, depth, n)) for n in tracked(range(len(depth)), name)])


def _timed(action: Callable[[], object]) -> float:
    start = time.thread_time()
    action()
    return time.thread_time() - start


def _sizes(recording: RecordedFrames) -> list[dict[str, Any]]:
    """Frame times in the middle of completely mapped environments of several sizes."""
    maps = [_mapped_environment(recording, size) for size in SIZES]
    times = np.array([_timed_in_all(maps, recording, n) for n in range(len(recording.xtion))])
    median = np.median(times, axis=0)
    ratio = np.median(times / times[:, :1], axis=0)
    return [
        {"size_m": size, "frame_ms": 1e3 * float(ms), "over_small": float(over), "bytes": metric_map.nbytes}
        for size, metric_map, ms, over in zip(SIZES, maps, median, ratio, strict=True)
    ]


def _timed_in_all(maps: list[MetricMap], recording: RecordedFrames, n: int) -> list[float]:
    """Seconds of one frame in each map, in turn, so that other load on the machine affects all maps alike."""
    frame = recording.xtion[n], recording.intrinsics, recording.T_map_camera[n]
    maps[0].integrate(*frame)
    return [_timed(partial(metric_map.integrate, *frame)) for metric_map in maps]


def _mapped_environment(recording: RecordedFrames, size: tuple[float, float]) -> MetricMap:
    """A map of an environment tiled with copies of the 6 m × 4 m arena."""
    metric_map = MetricMap()
    chosen = np.linspace(0, len(recording.xtion) - 1, TILE_FRAMES).astype(int)
    columns, rows = (int(np.ceil(length / tile)) for length, tile in zip(size, SMALL, strict=True))
    for i in tracked(range(columns), f"filling {size[0]:g} m × {size[1]:g} m"):
        for j in range(rows):
            for n in chosen:
                T = recording.T_map_camera[n].copy()
                T[:2, 3] += (i - columns // 2) * SMALL[0], (j - rows // 2) * SMALL[1]
                metric_map.integrate(recording.xtion[n], recording.intrinsics, T)
    return metric_map


def _accuracy(recording: RecordedFrames) -> dict[str, float]:
    """The report's accuracy figures for each map and sensor, and our map's agreement with exact ray traversal."""
    scored = MetricMap()
    score = VoxelScore(scored)
    for n in tracked(range(len(recording.ideal)), "following noise-free rays"):
        score.add(recording.points(recording.ideal, n).astype(np.float32), recording.T_map_camera[n, :3, 3])
    figures: dict[str, float] = {}
    for sensor, depth in (("ideal", recording.ideal), ("xtion", recording.xtion)):
        maps = {}
        for name, contender in (("ours", Projective(0.1)), ("rays", Rays(0.1)), ("octomap", OctoMap(0.1, True))):
            for n in tracked(range(len(depth)), f"{name}, {sensor}"):
                contender.prepare(recording, depth, n)()
            maps[name] = contender.metric_map()
            lower, upper = _bounds(maps[name], scored)
            scored.set_log_odds(lower, maps[name].log_odds(lower, upper))
            figures |= {f"{name}.{sensor}.{key}": value for key, value in score.report().items()}
        figures[f"agreement_with_rays.{sensor}"] = agreement(maps["ours"], maps["rays"])
    return figures


def agreement(first: MetricMap, second: MetricMap) -> float:
    """Fraction of the voxels known in either map that have the same state in both."""
    a, b = (np.sign(metric_map.log_odds(*_bounds(first, second))) for metric_map in (first, second))
    known = (a != 0) | (b != 0)
    return float((a == b)[known].mean())


def _bounds(first: MetricMap, second: MetricMap) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(3,) index of the lowest voxel of both maps, and (3,) index one past the highest voxel."""
    corners = np.array([*first.bounds(), *second.bounds()])
    return corners.min(axis=0), corners.max(axis=0)


class Projective:
    """The metric map, updated from depth images."""

    def __init__(self, voxel_size: float):
        self._map = MetricMap(MetricMapConfig(voxel_size=voxel_size))

    def prepare(self, recording: RecordedFrames, depth: NDArray[np.float32], n: int) -> Callable[[], object]:
        """A function that integrates the depth image."""
        return lambda: self._map.integrate(depth[n], recording.intrinsics, recording.T_map_camera[n])

    def metric_map(self) -> MetricMap:
        """The map itself."""
        return self._map

    @property
    def nbytes(self) -> int:
        """Memory of the voxels, bytes."""
        return self._map.nbytes


class Rays(Projective):
    """The metric map, updated from points by traversing every ray."""

    def __init__(self, voxel_size: float):
        # Depth images are clipped to the sensor's range along the optical axis; oblique rays are longer.
        self._map = MetricMap(MetricMapConfig(voxel_size=voxel_size, max_range=10))

    def prepare(self, recording: RecordedFrames, depth: NDArray[np.float32], n: int) -> Callable[[], object]:
        """A function that integrates the points."""
        points = recording.points(depth, n)
        return lambda: self._map.integrate_points(points, recording.T_map_camera[n, :3, 3])


class OctoMap:
    """OctoMap with default settings, on a grid aligned with the metric map's."""

    def __init__(self, voxel_size: float, discretize: bool):
        self._tree = pyoctomap.OcTree(voxel_size)
        self._discretize = discretize
        self._like = MetricMap(MetricMapConfig(voxel_size=voxel_size))

    def prepare(self, recording: RecordedFrames, depth: NDArray[np.float32], n: int) -> Callable[[], object]:
        """A function that inserts the points, which OctoMap takes as a contiguous array."""
        points = np.ascontiguousarray(recording.points(depth, n) - self._like.corner)
        origin = recording.T_map_camera[n, :3, 3] - self._like.corner
        return lambda: self._tree.insertPointCloud(points, origin, -1.0, False, self._discretize)

    def metric_map(self) -> MetricMap:
        """The octree's occupied and free leaves, as voxels of a metric map."""
        size = self._like.voxel_size
        for leaf in self._tree.begin_leafs():
            side = round(leaf.getSize() / size)
            lower = np.rint(np.array(leaf.getCoordinate()) / size - side / 2).astype(np.int64)
            value = 1 if self._tree.isNodeOccupied(leaf) else -1
            self._like.set_log_odds(lower, np.full((side, side, side), value, np.int8))
        return self._like

    @property
    def nbytes(self) -> int:
        """Memory of the octree as reported by OctoMap, bytes."""
        return self._tree.memoryUsage()


Contender = Projective | OctoMap
"""A mapping method: ``prepare`` returns a function that adds a frame; only this function is timed."""
