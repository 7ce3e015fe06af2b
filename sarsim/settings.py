"""What a user may ask of an episode; apart from the episode itself, for ``--help`` needs no more than this."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from sarsim.arenas.settings import RandomArenaConfig, StartPose
from sarsim.assets import asset

Labels = Literal["dgcnn", "truth"]
"""What labels the points: the network, or the simulator."""
Odometry = Literal["truth", "wheel"]
"""The true pose, or dead reckoning by wheels and gyro."""
LightingName = Literal["normal", "dim", "dark"]
"""See :class:`sarsim.sensors.lighting.Lighting`."""
WEIGHTS = asset("weights", "dgcnn.safetensors")
DETECTOR = asset("weights", "victims.cfg"), asset("weights", "victims.weights")


@dataclass(frozen=True)
class EpisodeConfig:
    """What an episode is made of.

    Attributes:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        start: where the robot begins: x and y in m, yaw in degrees; by default where the arena says.
        seed: of everything random; another one shows how much of a result is chance.
        steps: most steps (sense, map, plan, drive) of exploring, which ends before when no viewpoint is left; fewer
            make a short episode.
        map: folder of an earlier episode in the same arena, in whose map the robot finds its place and goes on.
        goals: places to drive to after exploring, x y x y … in m; the robot chooses a short order.
        home: drive back to the start in the end.
        labels: what labels the points: the network, or the simulator, to see what perfect labels would bring.
        weights: of the network, as train.py writes them.
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
        out: folder for the results; by default runs/<arena>-<seed>, or with --config, which overwrites no run, the
            same with the first number behind it that is free.
        random: what a random arena is like.
    """

    arena: str = "nist_6x4"
    start: StartPose | None = None
    seed: int = 0
    steps: int = 160
    map: Path | None = None
    goals: tuple[tuple[float, float], ...] = ()
    home: bool = False
    labels: Labels = "dgcnn"
    weights: Path = WEIGHTS
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
    out: Path | None = None
    random: RandomArenaConfig = field(default_factory=RandomArenaConfig)

    @property
    def folder(self) -> Path:
        """For the results."""
        return self.out or Path("runs") / f"{Path(self.arena).stem}-{self.seed}"
