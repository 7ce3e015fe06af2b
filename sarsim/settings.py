"""Settings of episodes, recordings and ROS 2 robots, in a module of their own: ``--help`` needs nothing else."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from itertools import chain, count
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro
from tyro.conf import Fixed

from pipeline.config import PipelineConfig
from pipeline.errors import InputError
from pipeline.io_config import IoConfig
from pipeline.ros.live.topic_names import TopicNames
from sarsim.arenas.settings import RandomArenaConfig, StartPose
from sarsim.assets import asset

NetworkName = Literal["pointnet", "pointnet2", "pointcnn", "dgcnn", "pointnext"]
POINT_NETWORKS: tuple[NetworkName, ...] = get_args(NetworkName)
Labels = NetworkName | Literal["rules", "truth"] | str
"""Source of the points' labels: a network, height and slope alone, the simulator, or a class, MODULE:CLASS."""
Exploration = Literal["next_best_view", "nearest_frontier", "random_walk"] | str
Localisation = Literal["slam", "odometry"] | str
Planner = Literal["topological"] | str
GridExplorer = (
    Literal[
        "next_best_view",
        "viewpoint_tour",
        "frontier_tour",
        "nearest_frontier",
        "random_tree",
        "learned",
        "random_walk",
        "oracle",
    ]
    | str
)
"""An explorer of 2D maps in sweeps; the oracle knows the map."""
METHODS = {
    flag: tuple(name for part in get_args(kind) for name in get_args(part))
    for flag, kind in {
        "exploration": Exploration,
        "labels": Labels,
        "detector-class": str,
        "localisation": Localisation,
        "planner": Planner,
        "methods": GridExplorer,
        "sink": str,
        "reader": str,
        "arena": str,
        "arenas": str,
    }.items()
}
"""Names of the methods that sarsim ships, by the flags that take MODULE:CLASS or MODULE:FUNCTION too."""
OwnClasses = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="MODULE:CLASS")]
"""Classes of the user's own, by a flag that may be repeated."""
Robot = Literal["pioneer3at", "jackal"] | str
"""A robot that sarsim ships, or the path of an MJCF file structured like theirs."""
Odometry = Literal["truth", "wheel"]
"""The true pose, or dead reckoning by wheels and gyro."""
LightingName = Literal["normal", "dim", "dark"]
"""See :class:`sarsim.sensors.lighting.Lighting`."""
NETWORK: NetworkName = "pointnext"
"""The default network."""
WEIGHTS = asset("weights", f"{NETWORK}.safetensors")
"""Weights of the default network."""
NOT_PORTABLE = r"[^\w.-]+"
"""What no name of a folder has, as a colon, which Windows and scp take for something else."""
EXPLORE = "explore"
"""The mission without a clock, of which nothing is handed in."""
DETECTOR = (asset("weights", "victims.safetensors"),)
"""File of the default detector."""
Networks = Annotated[  # the hint keeps the place of the installation out of --help, whose lines it would break
    tuple[Path, Path] | tuple[Path] | None, tyro.conf.arg(help_behavior_hint="(default: the shipped one)")
]


def is_own_arena(name: str) -> bool:
    """Whether ``--arena`` names a function of the user's own, MODULE:FUNCTION or an entry point."""
    return _is_function(name) or name in entry_points(group="sarsim.arena").names


def _is_function(name: str) -> bool:
    module, colon, function = name.partition(":")
    return bool(colon) and module != "random" and all(map(str.isidentifier, [*module.split("."), function]))


def names_code(flag: str, value: object) -> bool:
    """Whether a value of one of ``METHODS`` names code of the user's own, be it a single word or a list of words."""
    if flag in ("sink", "reader"):
        return bool(value)
    if flag in ("arena", "arenas"):
        return any(map(is_own_arena, words(value)))
    return ":" in str(value)


def words(value: object) -> Iterator[str]:
    """A YAML value as the words of a command line."""
    if isinstance(value, list):
        for item in value:
            yield from words(item)
    else:
        yield str(value)


@dataclass(frozen=True, kw_only=True)
class SinkConfig:
    """Settings of everything that leaves the files of a run.

    Attributes:
        sink: class of your own that watches the run and writes into its folder.
        io: all numbers of recordings, of the files of results and of ROS; only ``--config`` changes them.
    """

    sink: OwnClasses = ()
    io: Fixed[IoConfig] = IoConfig()


@dataclass(frozen=True, kw_only=True)
class SimulatorConfig:
    """Settings of everything that simulates a robot in an arena.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME, random:SEED, the path of a .raf, MJCF, SDF or map file, or
            MODULE:FUNCTION of your own.
        robot: pioneer3at, jackal, or the path of an MJCF file structured like theirs.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        seed: seed of all random numbers.
        lighting: light in the arena; in the dark, the robot's lamp is on.
    """

    arena: str = "nist_6x4"
    robot: Robot = "pioneer3at"
    start: StartPose | None = None
    seed: int = 0
    lighting: LightingName = "normal"


@dataclass(frozen=True, kw_only=True)
class PerceptionConfig:
    """Settings of everything that labels points and finds people.

    Attributes:
        labels: network, height and slope (rules), simulator's truth, or MODULE:CLASS.
        weights: weights file of the network, from train.py; by default the shipped one.
        detector: .cfg and .weights of Darknet, or .safetensors as shipped; None: off.
        detector_class: your own detector, MODULE:CLASS.
        reader: class of your own that finds objects in images.
        pipeline: all numbers of the robot's software; a run writes them, and only ``--config`` changes them.
    """

    labels: Labels = NETWORK
    weights: Path | None = None
    detector: Networks = DETECTOR if all(path.exists() for path in DETECTOR) else None
    detector_class: str | None = None
    reader: OwnClasses = ()
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class MissionConfig:
    """Settings of everything that drives a robot by its own maps.

    Attributes:
        steps: most steps of exploring; by default 160, or with --goals no limit.
        map: folder of an earlier episode here, in whose map the robot goes on.
        goals: places to drive to at once, x y x y … in m in the map; the robot orders them.
        explore: explore first, as with --steps.
        home: drive back at the end.
        speed: top speed, m/s; by default the robot's. The thesis drives at 0.2.
        view: live view of the run: in a new window (spawn), in the browser (web), or none.
        mission: explore, or with files handed in: league, virtual, FILE.
        minutes: clock of a mission, which ends it in place of --steps; by default its own.
        exploration: what chooses viewpoints; a class of your own by MODULE:CLASS.
    """

    steps: int | None = None
    map: Path | None = None
    goals: tuple[tuple[float, float], ...] = ()
    explore: bool = False
    home: bool = False
    speed: float | None = None
    view: Literal["none", "spawn", "web"] = "none"
    mission: str = EXPLORE
    minutes: float | None = None
    exploration: Exploration = "next_best_view"

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if self.minutes is not None and (self.mission == EXPLORE or not 0 < self.minutes < float("inf")):
            raise InputError(f"--minutes {self.minutes:g}: more than 0, and only with a --mission that has a clock")
        if self.speed is not None and not 0 < self.speed < float("inf"):
            raise InputError(f"--speed {self.speed:g}: more than 0")
        if self.steps is not None and self.steps < 1:
            raise InputError(f"--steps {self.steps}: at least 1 step")
        if not all(map(isfinite, chain.from_iterable(self.goals))):
            raise InputError(f"--goals {' '.join(f'{x:g} {y:g}' for x, y in self.goals)}: no place is there")

    @property
    def most_steps(self) -> float:
        """Most steps of exploring: none where the robot drives to goals at once."""
        if self.steps is not None:
            return self.steps
        return 160 if not self.goals else inf if self.explore else 0


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig(SinkConfig, PerceptionConfig, MissionConfig, SimulatorConfig):
    """Settings of an episode.

    Attributes:
        resume: folder of an interrupted episode, which is repeated bit for bit, with stored outputs of its networks,
            and then continued.
        odometry: dead reckoning by wheels and gyro, which drifts, or the true pose, for comparison.
        localisation: slam corrects odometry by depth images; or MODULE:CLASS.
        planner: planner on the topological map, or MODULE:CLASS.
        sensor: Xtion camera, or ideal: of the same range, without noise.
        dust: dust in the air, 0 to 1, which spoils depth and veils colours.
        tyre_error: relative error of the wheels' radius that the odometry does not know.
        fiducials: AprilTags on walls, to score the map.
        oracle: compare with the best tour of one who knows the ground; may take minutes.
        voxel_size: side of the metric map's voxels, m; by default 0.1, or as a --config file says.
        graph: graph for path planning: the thesis's minimum spanning tree (mst), or with loops (roadmap).
        bag: new folder for a ROS 2 bag of the robot's sensor data, commands and maps.
        bag_images: depth in whole mm (16UC1) or in m (32FC1); colour raw or as JPEG.
        tum: new folder for sensor data and true poses in the layout of TUM RGB-D.
        out: new folder for the results; by default runs/<arena>-<seed>, or if that is there, the first free number
            from -2 on.
        random: contents of a random arena.
    """

    resume: Path | None = None
    odometry: Odometry = "wheel"
    localisation: Localisation = "slam"
    planner: Planner = "topological"
    sensor: Literal["xtion", "ideal"] = "xtion"
    dust: float = 0.0
    tyre_error: float = 0.0
    fiducials: int = 0
    oracle: bool = False
    voxel_size: float | None = None
    graph: Literal["mst", "roadmap"] = "roadmap"
    bag: Path | None = None
    bag_images: Literal["16UC1", "32FC1", "16UC1-jpeg", "32FC1-jpeg"] = "16UC1"
    tum: Path | None = None
    out: Path | None = None
    random: RandomArenaConfig = field(default_factory=RandomArenaConfig)

    def __post_init__(self) -> None:
        """Let the flag set the voxels of the metric map."""
        super().__post_init__()
        if self.voxel_size is not None:
            metric_map = replace(self.pipeline.metric_map, voxel_size=self.voxel_size)
            object.__setattr__(self, "pipeline", replace(self.pipeline, metric_map=metric_map))

    @property
    def folder(self) -> Path:
        """Folder for the results; one that is free, unless ``out`` or ``resume`` names it."""
        if named := self.out or self.resume:
            return named
        name = self.arena if _is_function(self.arena) else Path(self.arena).stem
        stem = f"{re.sub(NOT_PORTABLE, '-', name)}-{self.seed}"
        names = chain([stem], (f"{stem}-{number}" for number in count(2)))
        return next(path for name in names if not (path := Path("runs", name)).exists())

    @property
    def continues(self) -> tuple[str, ...]:
        """A file that the folder for the results must have if it has any: that of an episode to be resumed."""
        return ("config.yaml",) if self.resume else ()


@dataclass(frozen=True, kw_only=True)
class TeleopConfig(SinkConfig):
    """Settings of a drive by a person.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME, random:SEED, the path of a .raf, MJCF, SDF or map file, or
            MODULE:FUNCTION of your own.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        robot: pioneer3at, jackal, or the path of an MJCF file structured like theirs.
        labels: source of the points' labels if --out is given, as in run_episode.py.
        reader: class of your own that finds objects in images if --out is given, as --sink.
        out: folder for the recording, the maps, the report and the page of the drive, the same files as an episode's
            but config.yaml; Rerun shows them during the drive. By default nothing is mapped.
        gamepad: joystick device of Linux, such as /dev/input/js0, whose left stick drives the robot as the keys do.
        pipeline: all numbers of the robot's software; only ``--config`` changes them.
    """

    arena: str = "nist_6x4"
    start: StartPose | None = None
    robot: Robot = "pioneer3at"
    labels: Labels = "truth"
    reader: OwnClasses = ()
    out: Path | None = None
    gamepad: Path | None = None
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class MapRecording(SinkConfig, PerceptionConfig):
    """A recording to map, and facts that it does not contain itself.

    Attributes:
        path: TUM RGB-D folder, folder of numbered images, ROS bag (MCAP, SQLite, ROS 1), or scene (.h5) of a dataset.
        out: folder for the results, the same files as an episode's.
        poses: source of the poses: recorded odometry corrected by registration (slam), registration alone, or
            odometry or true poses as recorded; by default slam if there is odometry, else registration.
        robot: robot that ground must suit: pioneer3at, jackal, or the path of an MJCF file structured like theirs.
        camera: pose of the camera on the robot: x y z in m, roll pitch yaw in degrees, positive pitch looks down; by
            default as recorded, else level, by accelerometer or surfaces.
        intrinsics: fx fy cx cy of the camera in pixels, with pixel centres at whole numbers; by default as recorded.
        depth_scale: units per metre of a folder's depth images; by default 5000.
        fps: frames per second of a folder whose images have no times.
        topics: names of the topics to use if a bag has several of a kind, also of transforms.
        mission: explore, or one whose files are handed in: league, virtual, or a YAML file.
    """

    path: Annotated[Path, tyro.conf.Positional]
    out: Path
    poses: Literal["slam", "registration", "odometry", "truth"] | None = None
    robot: Robot = "pioneer3at"
    camera: tuple[float, float, float, float, float, float] | None = None
    intrinsics: tuple[float, float, float, float] | None = None
    depth_scale: float | None = None
    fps: float | None = None
    topics: tuple[str, ...] = ()
    mission: str = EXPLORE


@dataclass(frozen=True, kw_only=True)
class RosRobotConfig(SimulatorConfig):
    """Settings of the node that simulates a robot.

    Attributes:
        camera_rate: camera images per simulated second; each takes some 50 ms to compute, a real Xtion gives 30.
        pace: pace of the simulated time: that of the wall clock (real-time), as fast as possible (free), or as fast
            as commands come (commands), waiting at most 0.1 s for each.
        stamped: receive commands as TwistStamped; by default as Twist.
        name: name of the ROS 2 node.
        network: connect to other machines as well, which may then drive the robot; by default only to this machine.
        out: folder for ground truth of the drive, report.json and trajectory_true.tum; by default neither is written.
        io: all numbers of ROS; only ``--config`` changes them.
    """

    camera_rate: float = 5.0
    pace: Literal["commands", "real-time", "free"] = "commands"
    stamped: bool = False
    name: str = "sarsim_robot"
    network: bool = False
    out: Path | None = None
    io: Fixed[IoConfig] = IoConfig()


@dataclass(frozen=True, kw_only=True)
class RosExploration(SinkConfig, PerceptionConfig, MissionConfig):
    """Settings of the exploration with a ROS 2 robot.

    Attributes:
        out: folder for the results, the same files as an episode's.
        robot: robot that ground must suit: pioneer3at, jackal, or the path of an MJCF file structured like theirs.
        camera: pose of the camera on the robot: x y z in m, roll pitch yaw in degrees, positive pitch looks down; by
            default from the robot's transforms.
        topics: names of the robot's topics.
        nav2: send viewpoints as goals to the robot's Nav2 stack instead of velocities.
        patience: longest silence of the robot or of one of its topics, s, before the drive ends.
        name: name of the ROS 2 node.
        network: connect to other machines as well; by default only to this machine.
    """

    out: Path
    robot: Robot = "pioneer3at"
    camera: tuple[float, float, float, float, float, float] | None = None
    topics: TopicNames = field(default_factory=TopicNames)
    nav2: bool = False
    patience: float = 5.0
    name: str = "sarsim_explorer"
    network: bool = False

    @property
    def folder(self) -> Path:
        """Folder for the results."""
        return self.out


@dataclass(frozen=True, kw_only=True)
class MissionValidation:
    """Files to check.

    Attributes:
        path: folder of the files, or an episode's that contains handed_in/.
        io: with the numbers of the validation (``league.validation``); only ``--config`` changes them.
    """

    path: Annotated[Path, tyro.conf.Positional]
    io: Fixed[IoConfig] = IoConfig()
