"""Settings of the benchmark's subjects, in a module of their own: ``--help`` needs nothing else."""

from dataclasses import dataclass, replace
from pathlib import Path

from tyro.conf import Fixed, FlagConversionOff

from pipeline.config import PipelineConfig
from sarsim.arenas.settings import RandomArenaConfig
from sarsim.flags import Given
from sarsim.settings import DETECTOR, WEIGHTS, EpisodeConfig, LightingName, Odometry, PerceptionConfig, Robot

SHARED = Path(__file__).resolve().parents[2].parent / "shared"  # Test data beside the checkout
ARENAS = "nist_6x4", "esogu_52x15"


@dataclass(frozen=True, kw_only=True)
class SubjectSettings:
    """Settings of every subject.

    Attributes:
        json: file for the figures, machine and settings. By default the figures are only printed.
    """

    json: Given[Path] = None


@dataclass(frozen=True, kw_only=True)
class CameraSettings(SubjectSettings):
    """Time per frame, against mujoco.Renderer.

    Attributes:
        frames: number of frames; more give more stable figures.
        width: width of the images, pixels.
        height: height of the images, pixels.
    """

    frames: int = 60
    width: Fixed[int] = 640
    height: Fixed[int] = 480


@dataclass(frozen=True, kw_only=True)
class CorrectionSettings(SubjectSettings):
    """Time to correct all maps after a loop closure, against rebuilding an octree from all frames.

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
        seed: seed of the episodes.
        steps: maximum number of steps of an episode.
    """

    arenas: tuple[str, ...] = ("nist_6x4", "random:3", "esogu_52x15")
    seed: int = 0
    steps: int = 160


@dataclass(frozen=True, kw_only=True)
class DatasetSettings(SubjectSettings):
    """Time per scene, against a generator that uses mujoco.Renderer, and with two workers.

    Attributes:
        scenes: number of scenes that each generator makes.
        frames: number of frames of a scene.
        rounds: number of rounds in which one worker and then two make a scene each.
        seed: seed of the arenas.
    """

    scenes: int = 4
    frames: int = 100
    rounds: int = 5
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class MetricMapSettings(SubjectSettings):
    """Time, memory and accuracy of the metric map, against ray traversal and OctoMap.

    Attributes:
        frames: number of frames of an arena.
        seed: seed of the drives.
        arenas: arenas in which accuracy is measured; times are measured in the first.
        baselines: also measure OctoMap without discretize, which takes 0.1 s per frame.
    """

    frames: int = 160
    seed: int = 0
    arenas: Fixed[tuple[str, ...]] = ARENAS
    baselines: FlagConversionOff[bool] = True


@dataclass(frozen=True, kw_only=True)
class PlanningSettings(SubjectSettings):
    """Planning time per step on completely mapped floors.

    Attributes:
        frames: number of steps on each floor.
        seed: seed of the robot's positions.
        arenas: arenas to plan in, the smallest first.
    """

    frames: int = 24
    seed: int = 0
    arenas: Fixed[tuple[str, ...]] = ARENAS


@dataclass(frozen=True, kw_only=True)
class LabelSettings(SubjectSettings):
    """Settings of the subjects that label frames of drives.

    Attributes:
        rounds: number of timed rounds.
        seed: seed of the drives.
        arenas: arenas that have figures of their own.
        raf: folder of .raf arenas to label as well.
    """

    rounds: int = 7
    seed: int = 0
    arenas: Fixed[tuple[str, ...]] = ARENAS
    raf: Path = SHARED / "arenas" / "raf"


@dataclass(frozen=True, kw_only=True)
class SemanticSettings(LabelSettings):
    """Time of DGCNN, its agreement with a published checkpoint, and the accuracy of the network's labels.

    Attributes:
        timed_frames: number of frames of nist_6x4 that are timed.
        frames: number of frames of an arena; 0 for no arena.
        raf_frames: number of frames of a .raf arena; 0 for none.
        checkpoint: folder of a published checkpoint and its logits; without it, agreement is not measured.
        weights: weights of the network that labels the points.
        confusion: folder of an episode; only list which objects its semantic map confuses with which class.
    """

    timed_frames: Fixed[int] = 10
    frames: int = 40
    raf_frames: int = 10
    checkpoint: Fixed[Path] = SHARED / "dgcnn"
    weights: Path = WEIGHTS
    confusion: Given[Path] = None


@dataclass(frozen=True, kw_only=True)
class NetworksSettings(LabelSettings):
    """Size, time and accuracy of all five networks.

    Attributes:
        timed_frames: number of frames of nist_6x4 that are timed.
        frames: number of frames of an arena; 0 for no arena.
        raf_frames: number of frames of a .raf or random arena; 0 for none.
        random: number of random arenas, of all four difficulties.
        lighting: light in the frames; by default normal and dark.
        weights: folder of weights files named after their networks.
    """

    timed_frames: Fixed[int] = 5
    frames: int = 24
    raf_frames: int = 8
    random: int = 20
    lighting: Given[LightingName] = None
    weights: Path = WEIGHTS.parent


@dataclass(frozen=True, kw_only=True)
class DrivesSettings(SubjectSettings):
    """Settings of the subjects that drive in many arenas.

    Attributes:
        nist: number of episodes in nist_6x4.
        esogu: number of episodes in esogu_52x15.
        random: number of random arenas of difficulties 0, 1 and 2, with an episode in each.
        lighting: light in the arenas.
        baselines: run the baselines too.
        workers: number of episodes at the same time. By default one per core.
        runs: folder for the result of each episode; finished episodes in it are not repeated.
    """

    nist: int = 10
    esogu: int = 2
    random: int = 30
    lighting: LightingName = "normal"
    baselines: FlagConversionOff[bool] = True
    workers: Given[int] = None
    runs: Path


@dataclass(frozen=True, kw_only=True)
class LocalisationSettings(DrivesSettings):
    """Localisation on recorded drives, against odometry, KISS-ICP and Open3D; each drive takes 0.5 GB in --runs.

    Attributes:
        raf: folder of .raf arenas to drive in as well.
        frames: maximum number of frames of a drive.
        seeds: seeds of the drives in each arena. By default one drive, with the number of the
            episode or of the random arena as its seed.
        kidnappings: number of times that the robot is carried elsewhere in each of nist_6x4 and random:1.
    """

    esogu: int = 1
    random: int = 9
    raf: Given[Path] = None
    frames: Fixed[int] = 3000
    seeds: tuple[int, ...] = ()
    kidnappings: int = 0
    runs: Path = Path("runs/benchmark-localisation")


@dataclass(frozen=True, kw_only=True)
class EpisodesSettings(PerceptionConfig, DrivesSettings):
    """Settings of the subjects that run whole episodes.

    Attributes:
        odometry: odometry of the episodes: wheels and gyro, or the true pose.
    """

    odometry: Odometry = "wheel"

    @property
    def episode(self) -> EpisodeConfig:
        """Settings that all episodes have."""
        return EpisodeConfig(
            odometry=self.odometry,
            lighting=self.lighting,
            labels=self.labels,
            weights=self.weights,
            detector=self.detector,
        )


@dataclass(frozen=True, kw_only=True)
class ExplorationSettings(EpisodesSettings):
    """Whole episodes, against the nearest frontier and a random walk.

    Attributes:
        raf: folder of .raf arenas to explore as well.
    """

    raf: Given[Path] = None
    runs: Path = Path("runs/benchmark-exploration")


@dataclass(frozen=True, kw_only=True)
class FindsSettings(EpisodesSettings):
    """Whole episodes in random arenas with objects of every kind, or a folder of real photos.

    Attributes:
        photos: folder of real photos with arena/, people/, rooms/ and truth.json; no episodes are run.
        things: number of objects in an arena, besides people.
    """

    nist: int = 0
    esogu: int = 0
    random: int = 10
    baselines: Fixed[bool] = False
    photos: Given[Path] = None
    things: Fixed[int] = 12
    detector: tuple[Path, Path] | tuple[Path] = DETECTOR
    runs: Path = Path("runs/benchmark-finds")

    @property
    def episode(self) -> EpisodeConfig:
        """Settings that all episodes have."""
        return replace(super().episode, random=RandomArenaConfig(things=self.things))


@dataclass(frozen=True, kw_only=True)
class VictimsSettings(EpisodesSettings):
    """Precision and time of the detector, and whole episodes, with and without it.

    Attributes:
        scenes: number of random arenas to render; 0 for none.
        frames: number of frames of an arena.
        seed: seed of these arenas; no network was trained on the default.
        rounds: number of timed frames; 0 skips the timing.
        detector: .cfg and .weights of any Darknet network, or a .safetensors file like the shipped one.
    """

    scenes: int = 30
    frames: int = 12
    seed: int = 2026
    rounds: int = 15
    detector: tuple[Path, Path] | tuple[Path] = DETECTOR
    runs: Path = Path("runs/benchmark-victims")


@dataclass(frozen=True, kw_only=True)
class GoalsSettings(SubjectSettings):
    """Goals 5 to 15 m away in unseen ground of random arenas: path length over the shortest possible.

    The search for people and objects is off, and labels come from height and slope.

    Attributes:
        arenas: number of random arenas with such goals, from random:0 on.
        goals: number of goals in each arena, one per run.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        workers: number of runs at the same time. By default one per core.
        runs: folder for the result of each run; finished runs in it are not repeated.
    """

    arenas: int = 10
    goals: int = 10
    robot: Robot = "pioneer3at"
    workers: Given[int] = None
    runs: Path = Path("runs/benchmark-goals")


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
    robot: Robot = "pioneer3at"
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class BarnSettings(SubjectSettings):
    """BARN's cylinder worlds, crossed autonomously with the robot's own camera.

    The search for people and objects is off, and labels come from height and slope.

    Attributes:
        worlds: folder with the BARN challenge's world_N.world and path_N.npy.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        seeds: number of runs in each world.
        speed: top speed on level, seen ground with enough clearance, m/s.
        workers: number of runs at the same time. By default one per core.
        runs: folder for the result of each run; finished runs in it are not repeated.
        pipeline: all numbers of the robot's software; set them in a ``--config`` file.
    """

    worlds: Path = SHARED / "barn"
    robot: Robot = "jackal"
    seeds: int = 3
    speed: float | None = EpisodeConfig.speed
    workers: Given[int] = None
    runs: Path = Path("runs/benchmark-barn")
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(SubjectSettings):
    """Missions in worlds of the rescue leagues' virtual robots, one mission in each world.

    Attributes:
        worlds: folder with the worlds and their models; a model.sdf that no world includes counts as a world.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        minutes: time limit of each mission in simulated minutes.
        seed: seed of every random number.
        workers: number of missions at the same time. By default one per core.
        runs: folder for the result of each mission; finished missions in it are not repeated.
        pipeline: all numbers of the robot's software; set them in a ``--config`` file.
    """

    worlds: Path = SHARED / "worlds"
    robot: Robot = "pioneer3at"
    minutes: Fixed[float] = 20.0
    seed: int = 0
    workers: int | None = None
    runs: Path = Path("runs/benchmark-worlds")
    pipeline: Fixed[PipelineConfig] = PipelineConfig()


@dataclass(frozen=True, kw_only=True)
class TasksSettings(SubjectSettings):
    """Steps per second of the Gymnasium tasks, and path lengths of the explorers of 2D maps.

    Attributes:
        steps: number of timed steps.
        drawn: number of generated maps on which to compare the explorers; 0 for none.
        maps: folder of dungeon maps on which to compare the explorers too.
    """

    steps: Fixed[int] = 2000
    drawn: int = 100
    maps: Given[Path] = None
