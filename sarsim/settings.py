"""What a user may ask of an episode or a recording; apart from these themselves, for ``--help`` needs no more."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from pipeline.recording.live.topic_names import TopicNames
from sarsim.arenas.settings import RandomArenaConfig, StartPose
from sarsim.assets import asset

NetworkName = Literal["pointnet", "pointnet2", "pointcnn", "dgcnn", "pointnext"]
POINT_NETWORKS: tuple[NetworkName, ...] = get_args(NetworkName)
Labels = NetworkName | Literal["rules", "truth"] | str
"""What labels the points: a network, height and slope alone, the simulator, or a class, module:Class."""
Robot = Literal["pioneer3at", "jackal"] | str
"""One that comes along, or the path of an MJCF file like theirs."""
Odometry = Literal["truth", "wheel"]
"""The true pose, or dead reckoning by wheels and gyro."""
LightingName = Literal["normal", "dim", "dark"]
"""See :class:`sarsim.sensors.lighting.Lighting`."""
NETWORK: NetworkName = "pointnext"
"""The default one."""
WEIGHTS = asset("weights", f"{NETWORK}.safetensors")
"""Of it."""
DETECTOR = asset("weights", "victims.cfg"), asset("weights", "victims.weights")


@dataclass(frozen=True)
class EpisodeConfig:
    """What an episode is made of.

    Attributes:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        robot: pioneer3at, jackal, or the path of an MJCF file like theirs.
        start: where the robot begins: x and y in m, yaw in degrees; by default where the arena says.
        seed: of everything random; another one shows how much of a result is chance.
        steps: most steps (sense, map, plan, drive) of exploring, which ends before when no viewpoint is left; fewer
            make a short episode.
        map: folder of an earlier episode in the same arena, in whose map the robot finds its place and goes on.
        resume: folder of an episode that was stopped: with its settings it is driven again from its start, and goes
            on; its seed makes it the same, bit for bit, and what its networks answered is not computed again.
        goals: places to drive to after exploring, x y x y … in m; the robot chooses a short order.
        home: drive back to the start in the end.
        labels: what labels the points: a network, height and slope alone (rules), the simulator (truth),
            to see what perfect labels would bring, or a class of yours, module:Class.
        weights: of the network, as train.py writes them; the shipped ones by default.
        detector: of victims: Darknet's .cfg and .weights of a YOLOv3; None looks for no victims, which is faster.
        odometry: dead reckoning by wheels and gyro, which drifts, or the true pose, for comparison.
        localisation: registration of what the camera sees (slam), or the odometry taken at its word.
        sensor: the Xtion with its noise, or its range alone, to see what noise costs.
        lighting: of the arena; in the dark the robot's lamp is on.
        dust: in the air, from 0 to 1; it swallows depth returns, makes false ones and veils colours.
        fiducials: AprilTags on the arena's walls, by which the report tells how true distances in the map are; the
            robot takes no notice of them.
        speed: at most, on seen level ground with room, m/s; the thesis drives at 0.2.
        voxel_size: of the metric map, m; smaller voxels show more detail and take more time and memory.
        graph: what plans are made on: the thesis's minimum spanning tree (mst), or the tree and loops that shorten
            detours.
        view: show the episode while it runs: in a new window (spawn), in the browser (web), or not at all.
        bag: new folder for a ROS 2 bag of all that the robot senses and does, and of its maps.
        bag_images: depth in it in whole mm (16UC1) or exactly, in m (32FC1); colours as they are or as JPEG.
        tum: new folder for its images, IMU, odometry and true poses in the layout of the TUM RGB-D benchmark.
        out: folder for the results; by default runs/<arena>-<seed>, or with --config, which overwrites no run, the
            same with the first number behind it that is free.
        random: what a random arena is like.
    """

    arena: str = "nist_6x4"
    robot: Robot = "pioneer3at"
    start: StartPose | None = None
    seed: int = 0
    steps: int = 160
    map: Path | None = None
    resume: Path | None = None
    goals: tuple[tuple[float, float], ...] = ()
    home: bool = False
    labels: Labels = NETWORK
    weights: Path | None = None
    detector: tuple[Path, Path] | None = DETECTOR if all(path.exists() for path in DETECTOR) else None
    odometry: Odometry = "wheel"
    localisation: Literal["slam", "odometry"] = "slam"
    sensor: Literal["xtion", "ideal"] = "xtion"
    lighting: LightingName = "normal"
    dust: float = 0.0
    fiducials: int = 0
    speed: float = 0.5
    voxel_size: float = 0.1
    graph: Literal["mst", "roadmap"] = "roadmap"
    view: Literal["none", "spawn", "web"] = "none"
    bag: Path | None = None
    bag_images: Literal["16UC1", "32FC1", "16UC1-jpeg", "32FC1-jpeg"] = "16UC1"
    tum: Path | None = None
    out: Path | None = None
    random: RandomArenaConfig = field(default_factory=RandomArenaConfig)

    @property
    def folder(self) -> Path:
        """For the results."""
        return self.out or self.resume or Path("runs") / f"{Path(self.arena).stem}-{self.seed}"


@dataclass(frozen=True)
class MapRecording:
    """What is mapped, and what the recording does not tell itself.

    Attributes:
        path: a TUM RGB-D folder, the folder or file of a ROS bag (MCAP, SQLite), or a scene's .h5 of a dataset.
        out: folder for the results, the same files as an episode's.
        poses: where they come from: recorded odometry, corrected by registration (slam), registration alone,
            recorded odometry or true poses taken at their word; by default slam if there is odometry.
        labels: what labels the points: a network, height and slope alone (rules), true labels that a
            simulator recorded (truth), or a class of yours, module:Class.
        weights: of the network, as train.py writes them; the shipped ones by default.
        detector: of victims: Darknet's .cfg and .weights of a YOLOv3; None looks for no victims, which is faster.
        robot: pioneer3at, jackal, or the path of an MJCF file like theirs, for which ground is judged.
        camera: of the camera on the robot: x y z in m, roll pitch yaw in degrees, pitch positive where it looks down;
            by default as the recording has it, else level over the floor of the first frame.
        intrinsics: of the camera, fx fy cx cy in pixels, pixel centres at whole numbers, as calibrations have them.
        depth_scale: of a folder's depth images, units a metre (5000).
        fps: frames per second of a folder whose images have no times.
        topics: of a bag, those to use where it has several of a kind.
    """

    path: Annotated[Path, tyro.conf.Positional]
    out: Path
    poses: Literal["slam", "registration", "odometry", "truth"] | None = None
    labels: Labels = NETWORK
    weights: Path | None = None
    detector: tuple[Path, Path] | None = DETECTOR if all(path.exists() for path in DETECTOR) else None
    robot: Robot = "pioneer3at"
    camera: tuple[float, float, float, float, float, float] | None = None
    intrinsics: tuple[float, float, float, float] | None = None
    depth_scale: float | None = None
    fps: float | None = None
    topics: tuple[str, ...] = ()


@dataclass(frozen=True)
class RosRobotConfig:
    """What the node simulates.

    Attributes:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        robot: pioneer3at, jackal, or the path of an MJCF file like theirs.
        start: where the robot begins: x and y in m, yaw in degrees; by default where the arena says.
        seed: of everything random; another one shows how much of a result is chance.
        lighting: of the arena; in the dark the robot's lamp is on.
        camera_rate: images a simulated second; each takes some 50 ms to compute, a real Xtion gives 30.
        pace: of the simulated time: that of the wall's clock (real-time), as fast as it goes (free), or as fast as
            commands come (commands), for each of which the robot waits 0.1 s at most.
        stamped: commands are TwistStamped.
        name: of the node.
        network: other machines may see the robot, and drive it; else nothing leaves this one.
        out: folder for what is true of the drive, report.json and trajectory_true.tum; by default it is not told.
    """

    arena: str = "nist_6x4"
    robot: Robot = "pioneer3at"
    start: StartPose | None = None
    seed: int = 0
    lighting: LightingName = "normal"
    camera_rate: float = 5.0
    pace: Literal["commands", "real-time", "free"] = "commands"
    stamped: bool = False
    name: str = "sarsim_robot"
    network: bool = False
    out: Path | None = None


@dataclass(frozen=True)
class RosExploration:
    """How a robot of ROS 2 explores.

    Attributes:
        out: folder for the results, the same files as an episode's.
        steps: most steps (sense, map, plan, drive) of exploring, which ends before when no viewpoint is left.
        map: folder of an earlier episode in the same place, in whose map the robot finds its place and goes on.
        goals: places to drive to after exploring, x y x y … in m; the robot chooses a short order.
        home: drive back to the start in the end.
        labels: what labels the points: a network, height and slope alone (rules), or a class of yours,
            module:Class.
        weights: of the network, as train.py writes them; the shipped ones by default.
        detector: of victims: Darknet's .cfg and .weights of a YOLOv3; None looks for no victims, which is faster.
        speed: at most, on seen level ground with room, m/s.
        view: show the drive while it goes on: in a new window (spawn), in the browser (web), or not at all.
        robot: pioneer3at, jackal, or the path of an MJCF file like theirs, for which ground is judged.
        camera: of the camera on the robot: x y z in m, roll pitch yaw in degrees, pitch positive where it looks down;
            by default as the robot's transforms have it.
        topics: what the robot's topics are called.
        patience: s that the robot, or one of its topics, may be silent.
        name: of the node.
        network: look for the robot on other machines as well.
    """

    out: Path
    steps: int = 160
    map: Path | None = None
    goals: tuple[tuple[float, float], ...] = ()
    home: bool = False
    labels: Labels = NETWORK
    weights: Path | None = None
    detector: tuple[Path, Path] | None = DETECTOR if all(path.exists() for path in DETECTOR) else None
    speed: float = 0.5
    view: Literal["none", "spawn", "web"] = "none"
    robot: Robot = "pioneer3at"
    camera: tuple[float, float, float, float, float, float] | None = None
    topics: TopicNames = field(default_factory=TopicNames)
    patience: float = 5.0
    name: str = "sarsim_explorer"
    network: bool = False

    @property
    def folder(self) -> Path:
        """For the results."""
        return self.out
