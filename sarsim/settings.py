"""Settings of episodes, manual drives and recordings, in a separate module so that ``--help`` starts fast."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from itertools import chain, count
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import tyro
from tyro.conf import Fixed

from pipeline.config import PipelineConfig
from pipeline.errors import InputError
from pipeline.io_config import IoConfig
from sarsim.arenas.settings import RandomArenaConfig, StartPose, WorldVictims
from sarsim.assets import asset
from sarsim.flags import Given

NetworkName = Literal["pointnet", "pointnet2", "pointcnn", "dgcnn", "pointnext"]
POINT_NETWORKS: tuple[NetworkName, ...] = get_args(NetworkName)
LabelSource = NetworkName | Literal["rules", "truth"] | str
"""Source of the points' labels: a network, rules without learning, the simulator, or a class, MODULE:CLASS."""
ExplorationName = Literal["next_best_view", "nearest_frontier", "random_walk"] | str
LocalisationName = Literal["slam", "odometry"] | str
PlannerName = Literal["topological"] | str
METHODS = {
    flag: tuple(name for part in get_args(kind) for name in get_args(part))
    for flag, kind in {
        "exploration": ExplorationName,
        "labels": LabelSource,
        "detector-class": str,
        "localisation": LocalisationName,
        "planner": PlannerName,
        "methods": ExplorationName,
        "sink": str,
        "reader": str,
        "arena": str,
        "arenas": str,
    }.items()
}
"""Names of the methods that sarsim ships, by flag; the flags also take MODULE:CLASS or MODULE:FUNCTION."""
OwnClasses = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="MODULE:CLASS")]
"""The user's own classes, given by a flag that may be repeated."""
RobotName = Literal["pioneer3at", "jackal"] | str
"""A robot that sarsim ships, or the path of an MJCF file with the same structure."""
OdometryName = Literal["truth", "wheel"]
"""The true pose, or dead reckoning by wheels and gyro."""
LightingName = Literal["normal", "dim", "dark"]
"""See :class:`sarsim.sensors.lighting.Lighting`."""
CameraNumbers = Annotated[
    tuple[float | None, float | None, float | None, float | None, float | None, float | None] | None,
    tyro.conf.arg(metavar="X Y Z ROLL PITCH YAW", help_behavior_hint=""),
]
"""A camera's pose, m and degrees, with None for numbers to keep as recorded; None if the flag is not given."""
CameraSize = Annotated[tuple[int, int], tyro.conf.arg(metavar="W H")]
"""Width and height of a camera's images, pixels."""
CAMERA_SIZE = (640, 480)
"""Width and height of the Xtion's images, pixels."""
IMAGE_SIDE_LIMITS, MAX_ASPECT_RATIO = (32, 4096), 4
"""Minimum and maximum side of the camera's images, pixels, and maximum ratio of the longer to the shorter side."""
DEFAULT_NETWORK: NetworkName = "pointnext"
"""Network that labels points by default."""
WEIGHTS = asset("weights", f"{DEFAULT_NETWORK}.safetensors")
"""File with the weights of the default network."""
NOT_PORTABLE = r"[^\w.-]+"
"""Characters kept out of the names of folders, such as the colon, to which Windows and scp give a special meaning."""
EXPLORE = "explore"
"""The mission without a time limit and without files to submit."""
DEFAULT_DETECTOR = (asset("weights", "victims.safetensors"),)
"""File of the default detector."""
DetectorFiles = Annotated[  # the hint replaces the installation's path, which would break the lines of --help
    tuple[Path, Path] | tuple[Path] | None,
    tyro.conf.arg(metavar="PATH [PATH], --no-detector", help_behavior_hint="(default: the shipped one)"),
]


def check_camera_size(size: tuple[int, int]) -> None:
    """Raise InputError if a size, width and height in pixels, is outside the limits of the camera's images."""
    (least, most), (shorter, longer) = IMAGE_SIDE_LIMITS, sorted(size)
    if shorter < least or longer > most or longer > MAX_ASPECT_RATIO * shorter:
        limits = f"from {least} to {most} pixels, and neither more than {MAX_ASPECT_RATIO} times the other"
        raise InputError(f"--camera-size {size[0]} {size[1]}: width and height must be {limits}")


def is_own_arena(name: str) -> bool:
    """Whether ``--arena`` names a function, MODULE:FUNCTION, or an entry point, NAME or NAME/PART."""
    return _is_function(name) or name.partition("/")[0] in entry_points(group="sarsim.arena").names


def is_shipped(name: str, group: str) -> bool:
    """Whether an entry point is one of sarsim's own, so that a settings file may choose it."""
    found = entry_points(group=group, name=name)
    return bool(found) and all(entry.dist is not None and entry.dist.name == "sarsim" for entry in found)


def _is_function(name: str) -> bool:
    module, colon, function = name.partition(":")
    return bool(colon) and module != "random" and all(map(str.isidentifier, [*module.split("."), function]))


def chooses_code(flag: str, value: object) -> bool:
    """Whether a flag's value in a settings file, one word or a list, names code that sarsim does not ship."""
    if flag in ("sink", "reader", "detector-class"):
        return bool(value)
    if flag not in METHODS and flag not in ("detector", "mission"):
        return False
    words = [str(word) for word in (value if isinstance(value, list) else [value])]
    if flag == "mission":
        missions = entry_points(group="sarsim.mission").names
        named = {word if word in missions else Path(word).suffix for word in words} & missions
        return not all(is_shipped(name, "sarsim.mission") for name in named)
    if flag in ("arena", "arenas"):
        own = filter(is_own_arena, words)
        return not all(is_shipped(word.partition("/")[0], "sarsim.arena") for word in own)
    installed = entry_points(group=f"sarsim.{'exploration' if flag == 'methods' else flag}").names
    return any(":" in word or word in installed for word in words)


@dataclass(frozen=True, kw_only=True)
class SinkConfig:
    """Settings of everything that writes the files of a run.

    Attributes:
        sink: your own class that observes the run.
        io: all parameters of recordings and result files; set them in a ``--config`` file.
        plugins: the plug-ins to use and their settings, by name; ``--NAME`` adds one.
    """

    sink: OwnClasses = ()
    plugins: Fixed[Mapping[str, Any]] = field(default_factory=dict)
    io: Fixed[IoConfig] = IoConfig()


@dataclass(frozen=True, kw_only=True)
class SimulatorConfig:
    """Settings of everything that simulates a robot in an arena.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME or random:SEED; the path of a .raf, MJCF, SDF or map file; or your
            own MODULE:FUNCTION.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        start: start pose: x and y in m, yaw in degrees. By default the arena's own start.
        seed: seed of every random number.
        lighting: light in the arena; if it is dark, the robot switches on its lamp.
        camera_size: size of the images in pixels.
    """

    arena: str = "nist_6x4"
    robot: RobotName = "pioneer3at"
    start: Given[StartPose] = None
    seed: int = 0
    lighting: LightingName = "normal"
    camera_size: CameraSize = CAMERA_SIZE

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        check_camera_size(self.camera_size)


@dataclass(frozen=True, kw_only=True)
class PerceptionConfig:
    """Settings of everything that labels points and finds people.

    Attributes:
        labels: source of the labels: a network, rules without learning, the simulator's truth, or MODULE:CLASS.
        weights: network weights file. By default the shipped one.
        detector: victim detector: .onnx, Darknet's .cfg and .weights, or a .safetensors file; --no-detector leaves
            out people.
        detector_names: file with the detector's classes, one per line. By default, a .names file next to it.
        detector_class: your own victim detector, MODULE:CLASS.
        reader: your own class that finds objects.
        pipeline: all parameters of the robot's software; set them in a ``--config`` file.
    """

    labels: LabelSource = DEFAULT_NETWORK
    weights: Given[Path] = None
    detector: DetectorFiles = DEFAULT_DETECTOR if all(path.exists() for path in DEFAULT_DETECTOR) else None
    detector_names: Given[Path] = None
    detector_class: Given[str] = None
    reader: OwnClasses = ()
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class MissionConfig:
    """Settings of everything that drives a robot autonomously.

    Attributes:
        steps: maximum number of exploration steps. By default no limit.
        map: folder of an earlier episode in this arena; the robot continues with its map.
        goals: goals to drive to, in any order: x y x y …, m in the map frame.
        explore: explore before visiting goals.
        home: return to the start at the end.
        speed: top speed, m/s. By default the robot's own.
        view: live view: in a new window (spawn), in the browser (web), or none.
        mission: explore, or a mission with files to submit: the name of one, such as league, or a YAML file.
        minutes: time limit of a mission in simulated minutes; it replaces --steps. By default the mission's own.
        exploration: method that chooses viewpoints, or your own MODULE:CLASS.
    """

    steps: Given[int] = None
    map: Given[Path] = None
    goals: Annotated[tuple[tuple[float, float], ...], tyro.conf.arg(help_behavior_hint="")] = ()
    explore: bool = False
    home: bool = False
    speed: Given[float] = None
    view: Literal["none", "spawn", "web"] = "none"
    mission: str = EXPLORE
    minutes: Given[float] = None
    exploration: ExplorationName = "next_best_view"

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if self.minutes is not None and self.mission == EXPLORE:
            raise InputError(f"--minutes {self.minutes:g}: requires a --mission other than {EXPLORE}")
        if self.minutes is not None and not 0 < self.minutes < float("inf"):
            raise InputError(f"--minutes {self.minutes:g}: must be positive and finite")
        if self.speed is not None and not 0 < self.speed < float("inf"):
            raise InputError(f"--speed {self.speed:g}: must be positive and finite")
        if self.steps is not None and self.steps < 1:
            raise InputError(f"--steps {self.steps}: must be at least 1")
        if not all(map(isfinite, chain.from_iterable(self.goals))):
            raise InputError(f"--goals {' '.join(f'{x:g} {y:g}' for x, y in self.goals)}: coordinates must be finite")

    @property
    def max_steps(self) -> float:
        """Maximum number of exploration steps; 0 if the robot drives to goals without exploring first."""
        if self.steps is not None:
            return self.steps
        return inf if self.explore or not self.goals else 0


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig(SinkConfig, PerceptionConfig, MissionConfig, SimulatorConfig):
    """Settings of an episode.

    Attributes:
        resume: folder of an interrupted episode, which is repeated from its stored network outputs and continued.
        odometry: dead reckoning from wheels and gyro (wheel), or the true pose (truth).
        localisation: correct odometry with depth images (slam) or not (odometry), or MODULE:CLASS.
        planner: path planner on the topological map, or your own MODULE:CLASS.
        sensor: the Xtion camera (xtion), or one with the same range but no noise (ideal).
        dust: density of dust in the air, 0 to 1; it degrades depth and fades colours.
        tyre_error: relative error of the wheel radius that the odometry assumes.
        scores: compare with the ground truth; this takes a tenth of the time.
        oracle: compare the drive with the best known tour of the arena; this can take minutes.
        voxel_size: voxel size of the metric map, m. By default 0.1.
        graph: graph for planning: a minimum spanning tree (mst), or one with loops (roadmap).
        tum: new folder for the drive in the TUM RGB-D layout.
        out: new folder for the results. By default runs/<arena>-<seed>, with -2, -3 … if it exists.
        victims: list of victims and starts in a published world.
        victims_state: state if the names do not give it.
        random: contents of a random arena.
    """

    resume: Given[Path] = None
    odometry: OdometryName = "wheel"
    localisation: LocalisationName = "slam"
    planner: PlannerName = "topological"
    sensor: Literal["xtion", "ideal"] = "xtion"
    dust: float = 0.0
    tyre_error: float = 0.0
    scores: bool = True
    oracle: bool = False
    voxel_size: Given[float] = None
    graph: Literal["mst", "roadmap"] = "roadmap"
    tum: Given[Path] = None
    out: Given[Path] = None
    victims: Given[Path] = None
    victims_state: Literal["alive", "dead"] = "dead"
    random: RandomArenaConfig = field(default_factory=RandomArenaConfig)

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range, and apply ``voxel_size`` to the metric map."""
        MissionConfig.__post_init__(self)
        SimulatorConfig.__post_init__(self)
        if self.voxel_size is not None:
            metric_map = replace(self.pipeline.metric_map, voxel_size=self.voxel_size)
            object.__setattr__(self, "pipeline", replace(self.pipeline, metric_map=metric_map))

    @property
    def world_victims(self) -> WorldVictims:
        """Settings of the victims in a published world."""
        return WorldVictims(self.victims, self.victims_state)

    @property
    def folder(self) -> Path:
        """Folder for the results; a new one unless ``out`` or ``resume`` names it."""
        if named := self.out or self.resume:
            return named
        name = self.arena if _is_function(self.arena) else Path(self.arena).stem
        stem = f"{re.sub(NOT_PORTABLE, '-', name)}-{self.seed}"
        names = chain([stem], (f"{stem}-{number}" for number in count(2)))
        return next(path for name in names if not (path := Path("runs", name)).exists())

    @property
    def marks(self) -> tuple[str, ...]:
        """Names of files, one of which a non-empty folder for the results must contain; empty without ``resume``."""
        return ("config.yaml",) if self.resume else ()


@dataclass(frozen=True, kw_only=True)
class TeleopConfig(SinkConfig):
    """Settings of a drive by a person.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME or random:SEED; the path of a .raf, MJCF, SDF or map file; or your
            own MODULE:FUNCTION.
        start: start pose: x and y in m, yaw in degrees. By default the arena's own start.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        labels: source of the labels if --out is given, as in sarsim-episode.
        reader: your own class that finds objects in images if --out is given.
        out: new folder for the recording, maps and report of the drive: the files of an episode except config.yaml.
            Rerun shows the maps during the drive. Without --out nothing is mapped.
        gamepad: Linux joystick device, such as /dev/input/js0; its left stick drives the robot.
        pipeline: all parameters of the robot's software; set them in a ``--config`` file.
    """

    arena: str = "nist_6x4"
    start: Given[StartPose] = None
    robot: RobotName = "pioneer3at"
    labels: LabelSource = "truth"
    reader: OwnClasses = ()
    out: Given[Path] = None
    gamepad: Given[Path] = None
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class MapRecordingConfig(SinkConfig, PerceptionConfig):
    """A recording to map, and information that the recording does not contain.

    Attributes:
        path: TUM RGB-D folder, folder of numbered images, ROS bag (MCAP, SQLite, ROS 1), or dataset scene (.h5).
        out: new folder for the results: the same files as an episode writes.
        poses: source of the poses: recorded odometry corrected by registration (slam), registration alone, or the
            recorded odometry or true poses uncorrected. By default slam if odometry was recorded, else registration.
        robot: robot that determines which ground is traversable: pioneer3at, jackal, or the path of an MJCF file.
        camera_pose: pose of the camera on the robot: x y z in m, roll pitch yaw in degrees; a positive pitch looks
            down. None in place of a number keeps the recorded number. By default the recorded pose, or, if none was
            recorded, an estimate from the accelerometer or from floor and walls.
        intrinsics: fx fy cx cy of the camera in pixels; pixel centres are at whole numbers. By default as recorded.
        depth_scale: depth units per metre in a folder's images. By default 5000, or 1 for images of floats.
        depth_range: nearest and farthest depth that the camera measures, m. By default from the camera that the
            recording names, or else 0.5 to 5 m.
        depth_noise: standard deviation of depth at 1 m, m; it grows with the square of depth. By default from the
            camera that the recording names, or else a Kinect's.
        fps: frames per second of a folder whose images have no timestamps.
        topics: topics to use if a bag has several of the same kind, including transforms.
        mission: explore, or a mission with files to submit: the name of one, such as league, or a YAML file.
    """

    path: Annotated[Path, tyro.conf.Positional]
    out: Path
    poses: Given[Literal["slam", "registration", "odometry", "truth"]] = None
    robot: RobotName = "pioneer3at"
    camera_pose: CameraNumbers = None
    intrinsics: Given[tuple[float, float, float, float]] = None
    depth_scale: Given[float] = None
    depth_range: Given[tuple[float, float]] = None
    depth_noise: Given[float] = None
    fps: Given[float] = None
    topics: tuple[str, ...] = ()
    mission: str = EXPLORE
