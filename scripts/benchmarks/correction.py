"""Time to correct the maps after loop closures, compared with inserting all frames again, as octree mappers must.

The robot drives to random places until it has enough keyframes, one every 0.3 m or 15°. Then all keyframes after a
random one are moved, the newest the farthest, as in a correction after a loop closure.
"""

import resource
from collections.abc import Iterator

import numpy as np
import pyoctomap
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.exploration.baselines import RandomWalk
from pipeline.explorer import Explorer
from pipeline.keyframes import KeyframeObservation, Keyframes
from pipeline.mapper import Keyframe, Mapper
from pipeline.metric_map.metric_map import MetricMap
from pipeline.run import explore
from pipeline.sink import Sink
from pipeline.transforms import from_yaw
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import tracked
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least, wall_time_of
from scripts.benchmarks.settings import CorrectionSettings

DRIVES = {"nist_6x4": 300, "random:3": 1000}
"""Number of keyframes of each arena's drive, after which corrections are measured."""
MAX_SHIFT, MAX_TURN = 0.1, np.deg2rad(1.5)
"""Maximum correction of the newest keyframe along each axis, m, and in yaw, rad."""


def measure(settings: CorrectionSettings) -> Result:
    """Seconds per correction in each arena, and whether the maps equal maps rebuilt from scratch."""
    check_at_least(1, settings, "rounds")
    check_at_least(0, settings, "seed")
    rounds, seed = settings.rounds, settings.seed
    figures, equal = dict[str, float](), list[bool]()
    for arena, size in DRIVES.items():
        # Set up: the maps of a drive, and an octree of the same keyframes.
        mapper, octree = map_drive(arena, size, seed)
        rng = np.random.default_rng(seed)
        # Measure simulated corrections, and compare the maps with maps rebuilt from scratch.
        times = []
        for poses in tracked(
            list(_corrected(mapper.keyframes.poses, rounds, rng)), f"corrections of {size} keyframes"
        ):
            times.append(wall_time_of(mapper.correct, poses))
        equal.append(are_equal(mapper, rebuilt(mapper)))
        figures |= {
            f"{size}.correction_s.median": float(np.median(times)),
            f"{size}.correction_s.p95": float(np.percentile(times, 95)),
            f"{size}.reinsertion_s": octree.seconds,
            f"{size}.bytes_per_keyframe": _stored_bytes(mapper) / len(mapper.keyframes),
            f"{size}.process_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        }
    most = max(value for name, value in figures.items() if name.endswith("bytes_per_keyframe"))
    return Result(figures | {"equal": float(all(equal)), "bytes_per_keyframe": most})


def map_drive(arena: str, size: int, seed: int) -> tuple[Mapper, "OctreeSink"]:
    """The maps of a drive with ``size`` keyframes, and an octree of the same keyframes."""
    robot = SimulatedRobot(load_arena(arena), SimulationConfig("wheel"), seed)
    mapper = make_mapper(TRUE_LABELS, robot.model, seed)
    octree, explorer = OctreeSink(mapper.metric_map), Explorer(robot, mapper)
    explorer.watch(octree)
    explorer.mission.exploration = RandomWalk(robot.model, seed, steps=size)
    explore(explorer, may_step=lambda: len(mapper.keyframes) < size)
    robot.close()
    return mapper, octree


class OctreeSink(Sink):
    """Inserts every keyframe into an octree.

    Attributes:
        seconds: total insertion time so far, s; correcting the octree takes as long.
    """

    def __init__(self, metric_map: MetricMap):
        """Use the voxel size and maximum range of a metric map."""
        self._octree, self._range = pyoctomap.OcTree(metric_map.voxel_size), metric_map.max_range
        self.seconds = 0.0

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Insert the newest keyframe."""
        T_map_camera = keyframe.T_map_base @ keyframe.frame.T_base_camera
        points = keyframe.frame.points(T_map_camera).astype(np.float64)
        about = points, T_map_camera[:3, 3], self._range, False, True
        self.seconds += wall_time_of(self._octree.insertPointCloud, *about)


def _corrected(poses: NDArray[np.float64], rounds: int, rng: np.random.Generator) -> Iterator[Poses]:
    """Yield (K, 4, 4) poses after each of ``rounds`` random corrections of the same (K, 4, 4) poses."""
    for _ in range(rounds):
        first = rng.integers(len(poses))
        share = np.clip(np.arange(len(poses)) - first, 0, None) / max(len(poses) - 1 - first, 1)
        x, y = rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2)
        yaw = rng.uniform(-MAX_TURN, MAX_TURN)
        yield np.array([from_yaw(s * x, s * y, 0.0, s * yaw) @ T for s, T in zip(share, poses, strict=True)])


def rebuilt(mapper: Mapper) -> Mapper:
    """Another mapper, with every map rebuilt from the first mapper's keyframes."""
    other, keyframes = make_mapper(TRUE_LABELS, mapper.elevation_map.robot), mapper.keyframes
    for seen, T in zip(keyframes.observations, keyframes.poses, strict=True):
        other.keyframes.add(seen, T)
    for k, evidence in keyframes.ground_evidence:
        other.keyframes.add_ground(k, evidence)
    other.segments.members, other.victims.all = mapper.segments.members, mapper.victims.all
    other.restore()
    return other


def are_equal(one: Mapper, other: Mapper) -> bool:
    """Whether two mappers have the same maps, bit for bit."""
    pairs = zip(_contents(one), _contents(other), strict=True)
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in pairs)


def _contents(mapper: Mapper) -> Iterator[NDArray]:
    metric, semantic, ground = mapper.metric_map, mapper.semantic_map, mapper.elevation_map
    yield from (metric.occupied_centres(), metric.free_centres(), semantic.points(), semantic.probabilities())
    known = np.argwhere(np.isfinite(ground.elevation))
    yield from (known + ground.grid.low, ground.elevation[tuple(known.T)], ground.measured[tuple(known.T)])
    for segment in mapper.segments:
        yield from (segment.cells, segment.box.extent)


def _stored_bytes(mapper: Mapper) -> int:
    """Bytes stored for the keyframes by the maps, the segments, the victims and the localisation."""
    saved = mapper.localisation.keyframes()
    sightings = (sighting for victim in mapper.victims.all for sighting in victim.seen)
    parts = (*mapper.segments.members, *sightings, saved, saved.odometry)
    arrays = (value for part in parts for value in vars(part).values() if isinstance(value, np.ndarray))
    return observation_bytes(mapper.keyframes) + sum(array.nbytes for array in arrays)


def observation_bytes(keyframes: Keyframes) -> int:
    """Bytes of the keyframes' observations."""
    drives = [evidence for _, evidence in keyframes.ground_evidence if not isinstance(evidence, KeyframeObservation)]
    return sum(seen.nbytes for seen in keyframes.observations) + sum(
        a.nbytes for d in drives for a in vars(d).values()
    )
