"""Settings of the benchmark's subjects, kept in a separate module so that ``--help`` starts fast."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

from tyro.conf import Fixed, FlagConversionOff

from pipeline.config import PipelineConfig
from sarsim.arenas.settings import RandomArenaConfig
from sarsim.flags import Given
from sarsim.settings import (
    DEFAULT_DETECTOR,
    WEIGHTS,
    EpisodeConfig,
    LightingName,
    OdometryName,
    PerceptionConfig,
    RobotName,
)

SHARED = Path(__file__).resolve().parents[2].parent / "shared"  # Test data next to the checkout
ARENAS = "nist_6x4", "esogu_52x15"
RANDOM = tuple(f"random:{seed}" for seed in (0, 1, 2, 4, 5, 6, 8, 9, 10, 12))
"""Random arenas of difficulties 0 to 2; an arena's difficulty is its seed modulo 4."""


@dataclass(frozen=True, kw_only=True)
class SubjectSettings:
    """Settings of every subject.

    Attributes:
        json: file for the figures, machine and settings. By default the figures are only printed.
    """

    json: Given[Path] = None


@dataclass(frozen=True, kw_only=True)
class CameraSettings(SubjectSettings):
    """Time per frame, compared with mujoco.Renderer.

    Attributes:
        frames: number of frames; more frames give more stable figures.
    """

    frames: int = 60


@dataclass(frozen=True, kw_only=True)
class CorrectionSettings(SubjectSettings):
    """Time to correct all maps after a loop closure, compared with rebuilding an octree from all frames.

    Attributes:
        rounds: number of corrections in each arena.
        seed: seed of the drives and of the corrections.
    """

    rounds: int = 30
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class CostSettings(SubjectSettings):
    """Processor time of whole episodes, by stage and relative to the simulation alone.

    Attributes:
        arenas: arenas of the episodes.
        finds: also look for signs, codes and shapes, as in a mission.
        seed: seed of the episodes.
        steps: maximum number of steps of an episode.
    """

    arenas: tuple[str, ...] = ("nist_6x4", "random:3", "esogu_52x15")
    finds: bool = False
    seed: int = 0
    steps: int = 160


@dataclass(frozen=True, kw_only=True)
class DatasetSettings(SubjectSettings):
    """Time per frame, compared with a generator that uses mujoco.Renderer, and throughput of two workers.

    Attributes:
        scenes: number of scenes that each generator makes.
        frames: number of frames per scene.
        rounds: number of rounds; in each round, first one worker and then two workers make a scene each.
        seed: seed of the arenas.
    """

    scenes: int = 4
    frames: int = 100
    rounds: int = 5
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class LidarSettings(SubjectSettings):
    """Time per scan of the lidar, its labels compared with Open3D's ray casting, and errors of KISS-ICP on its scans.

    Attributes:
        arenas: arenas of the scans; times are measured in the first arena.
        rounds: number of timed scans per sensor.
        scenes: number of scenes that two workers make together.
        frames: number of scans per scene.
        drive: number of scans per drive, ten per second.
        seed: seed of every random number.
    """

    arenas: tuple[str, ...] = ARENAS
    rounds: int = 40
    scenes: int = 20
    frames: int = 100
    drive: Fixed[int] = 300
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class MetricMapSettings(SubjectSettings):
    """Time, memory and accuracy of the metric map, compared with ray traversal and OctoMap.

    Attributes:
        frames: number of frames per arena.
        seed: seed of the drives.
    """

    frames: int = 160
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class PlanningSettings(SubjectSettings):
    """Planning time per step on completely mapped floors.

    Attributes:
        steps: number of steps on each floor.
        seed: seed of the robot's poses and of the noise.
    """

    steps: int = 24
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class SemanticSettings(SubjectSettings):
    """Time of DGCNN, its agreement with a published checkpoint, and the accuracy of the network's labels.

    Attributes:
        rounds: number of timed rounds.
        seed: seed of the drives.
        frames: number of frames per arena; 0 for no arena.
        raf_frames: number of frames per .raf arena; 0 for no .raf arena.
        raf: folder of .raf arenas to label as well.
        weights: weights of the network that labels the points.
    """

    rounds: int = 7
    seed: int = 0
    frames: int = 40
    raf_frames: int = 10
    raf: Path = SHARED / "arenas" / "raf"
    weights: Path = WEIGHTS


@dataclass(frozen=True, kw_only=True)
class NetworksSettings(SemanticSettings):
    """Size, time and accuracy of all five networks.

    Attributes:
        random: number of random arenas, of all four difficulties. The number of frames is --raf-frames in each of
            them, or --frames if --raf-frames is 0.
        lighting: light in the frames; by default normal and dark.
        weights: folder of weights files named after their networks.
    """

    frames: int = 24
    raf_frames: int = 8
    random: int = 20
    lighting: Given[LightingName] = None
    weights: Path = WEIGHTS.parent


@dataclass(frozen=True, kw_only=True)
class RunsSettings(SubjectSettings):
    """Settings of the subjects that run episodes.

    Attributes:
        workers: number of episodes that run at the same time. By default one per core.
        runs: folder for the result of each episode; finished episodes in it are not repeated.
    """

    workers: Given[int] = None
    runs: Path


@dataclass(frozen=True, kw_only=True)
class LoopsSettings(RunsSettings):
    """Loop closures and uncertainty of the pose, on tours through worlds in which loops matter.

    Attributes:
        worlds: ring, wings, storeys, hall and panels, or names or files of arenas.
        seeds: seeds of the tours in each world.
        length: length of a tour, m.
    """

    worlds: tuple[str, ...] = ("ring", "wings", "storeys", "hall", "panels")
    seeds: tuple[int, ...] = (0, 1, 2)
    length: Fixed[float] = 160.0
    runs: Path = Path("runs/benchmark-loops")


@dataclass(frozen=True, kw_only=True)
class DrivesSettings(RunsSettings):
    """Settings of the subjects that drive in many arenas.

    Attributes:
        arenas: names or files of arenas, or folders of .raf arenas.
        seeds: seeds of the episodes in each arena.
        lighting: light in the arenas.
        baselines: also run the baselines.
    """

    arenas: tuple[str, ...] = (*ARENAS, *RANDOM)
    seeds: tuple[int, ...] = (0, 1)
    lighting: LightingName = "normal"
    baselines: FlagConversionOff[bool] = True


@dataclass(frozen=True, kw_only=True)
class LocalisationSettings(DrivesSettings):
    """Localisation along drives, compared with odometry, KISS-ICP and Open3D.

    Attributes:
        kidnappings: number of times that the robot is carried elsewhere in each of nist_6x4 and random:1.
    """

    seeds: tuple[int, ...] = (0,)
    kidnappings: int = 0
    runs: Path = Path("runs/benchmark-localisation")


@dataclass(frozen=True, kw_only=True)
class EpisodesSettings(PerceptionConfig, DrivesSettings):
    """Settings of the subjects that run whole episodes.

    Attributes:
        odometry: odometry of the episodes: wheels and gyro, or the true pose.
    """

    odometry: Fixed[OdometryName] = "wheel"

    @property
    def episode(self) -> EpisodeConfig:
        """Settings that all episodes share."""
        perception = {field.name: getattr(self, field.name) for field in fields(PerceptionConfig)}
        return EpisodeConfig(odometry=self.odometry, lighting=self.lighting, **perception)


@dataclass(frozen=True, kw_only=True)
class ExplorationSettings(EpisodesSettings):
    """Whole episodes, compared with the nearest-frontier strategy except in large arenas."""

    runs: Path = Path("runs/benchmark-exploration")


@dataclass(frozen=True, kw_only=True)
class FindsSettings(EpisodesSettings):
    """Whole episodes in random arenas with objects of every kind, or a folder of real photos.

    Attributes:
        photos: folder of real photos with arena/, people/, rooms/ and truth.json; no episodes are run.
    """

    arenas: tuple[str, ...] = RANDOM
    seeds: tuple[int, ...] = (0,)
    baselines: Fixed[bool] = False
    photos: Given[Path] = None
    detector: tuple[Path, Path] | tuple[Path] = DEFAULT_DETECTOR
    runs: Path = Path("runs/benchmark-finds")

    @property
    def episode(self) -> EpisodeConfig:
        """Settings that all episodes share."""
        return replace(super().episode, random=RandomArenaConfig(things=12))


@dataclass(frozen=True, kw_only=True)
class VictimsSettings(EpisodesSettings):
    """Precision and time of the detector, and whole episodes with and without the detector.

    Attributes:
        scenes: number of random arenas to render; 0 for none.
        frames: number of frames per arena.
        seed: seed of these arenas; no network was trained on the arenas of the default seed.
        rounds: number of timed frames; 0 skips the timing.
        detector: an .onnx file, .cfg and .weights of any Darknet network, or the shipped .safetensors file.
    """

    scenes: int = 30
    frames: int = 12
    seed: int = 2026
    rounds: int = 15
    detector: tuple[Path, Path] | tuple[Path] = DEFAULT_DETECTOR
    runs: Path = Path("runs/benchmark-victims")


@dataclass(frozen=True, kw_only=True)
class LanesSettings(PerceptionConfig, SubjectSettings):
    """Autonomous traverses of RoboCup Rescue's lanes, in both directions.

    Attributes:
        lanes: names of the lanes. By default all.
        repetitions: number of traverses in each lane.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        seed: seed of every random number.
    """

    lanes: tuple[str, ...] = ()
    repetitions: int = 10
    robot: RobotName = "pioneer3at"
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class BarnSettings(RunsSettings):
    """BARN's cylinder worlds, crossed autonomously with the robot's own camera.

    The search for people and objects is off, and labels come from rules.

    Attributes:
        worlds: folder with the BARN challenge's world_N.world and path_N.npy.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        seeds: number of runs in each world.
        speed: top speed on level, seen ground with enough clearance, m/s. By default the robot's own.
        pipeline: all parameters of the robot's software; set them in a ``--config`` file.
    """

    worlds: Path = SHARED / "barn"
    robot: RobotName = "jackal"
    seeds: int = 3
    speed: Given[float] = EpisodeConfig.speed
    runs: Path = Path("runs/benchmark-barn")
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(RunsSettings):
    """Missions of 20 minutes in worlds of the rescue leagues' virtual robots, one mission in each world.

    Attributes:
        worlds: folder with the worlds and their models; a model.sdf that no world includes is used as a world.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        seed: seed of every random number.
        pipeline: all parameters of the robot's software; set them in a ``--config`` file.
    """

    worlds: Path = SHARED / "worlds"
    robot: RobotName = "pioneer3at"
    seed: int = 0
    runs: Path = Path("runs/benchmark-worlds")
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class TasksSettings(SubjectSettings):
    """Step rates of the Gymnasium task Drive-v0.

    Attributes:
        steps: number of timed steps.
    """

    steps: Fixed[int] = 500


SUBJECTS: dict[str, type[SubjectSettings]] = {
    "barn": BarnSettings,
    "camera": CameraSettings,
    "correction": CorrectionSettings,
    "cost": CostSettings,
    "dataset": DatasetSettings,
    "exploration": ExplorationSettings,
    "finds": FindsSettings,
    "lanes": LanesSettings,
    "lidar": LidarSettings,
    "localisation": LocalisationSettings,
    "loops": LoopsSettings,
    "metric-map": MetricMapSettings,
    "networks": NetworksSettings,
    "planning": PlanningSettings,
    "semantic": SemanticSettings,
    "tasks": TasksSettings,
    "victims": VictimsSettings,
    "worlds": WorldsSettings,
}
"""The settings of each subject; the module with the subject's name in this folder has a function ``measure``."""
