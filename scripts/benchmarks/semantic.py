"""The semantic map: DGCNN made fast against DGCNN as written, and how right network, fused map and baseline are."""

from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import Any

from rich.progress import track

from pipeline.errors import InputError
from pipeline.semantic_map.networks.classifier import DgcnnClassifier, DgcnnConfig
from pipeline.semantic_map.planar_vote import PlanarVoteConfig
from sarsim.assets import asset
from sarsim.scripts.benchmarks.labelled_drives import drive_through
from sarsim.scripts.benchmarks.semantic_accuracy import accuracy
from sarsim.scripts.benchmarks.semantic_speed import THREADS, agreement, speed
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.sensors.lighting import Lighting

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
"""Test data beside the checkout."""
WEIGHTS = asset("weights", "dgcnn.safetensors")
LIGHTINGS = {"": Lighting.normal, ".dark": Lighting.dark}
"""By what is appended to the names of the figures."""


KEYFRAMES = (2.0, 0.8)
"""m and rad between the frames whose labels are compared: far apart, to show more than where an arena begins."""


@dataclass(frozen=True)
class Semantic(Subject):
    """DGCNN's speed, its agreement with a published checkpoint, and its accuracy in arenas it was not trained on."""

    rounds: int = 7
    """Blocks of 4,096 points for which both formulations take turns."""
    timed_frames: int = 10
    """Frames of nist_6x4 that are timed."""
    frames: int = 40
    """Frames of each arena whose labels are compared; 0 for none."""
    raf_frames: int = 10
    """Frames of each .raf arena, likewise."""
    seed: int = 0
    """Of the drives and the sensor's errors."""
    arenas: tuple[str, ...] = ("nist_6x4", "esogu_52x15")
    """Names or paths of arenas with figures of their own."""
    raf: Path = SHARED / "arenas" / "raf"
    """Folder with .raf files, for the mean over them; left out if there is none."""
    checkpoint: Path = SHARED / "dgcnn"
    """Folder with a published checkpoint and its answers; left out if there is none."""
    vote: bool = True
    """Whether the points of a plane vote on what they are."""
    weights: Path = WEIGHTS
    """Of the network; where the file is missing, there are no figures of it."""

    def measure(self) -> Result:
        """Speed, agreement, accuracy.

        Raises:
            InputError: there is nothing to measure, or an arena or the weights are broken.
        """
        if min(self.rounds, self.timed_frames) < 1 or min(self.frames, self.raf_frames) < 0:
            raise InputError(
                "--rounds and --timed-frames: give at least 1; --frames, --raf-frames: at least 0"
            )
        figures = speed(list(drive_through("nist_6x4", self.timed_frames, self.seed)), self.rounds)
        if self.checkpoint.is_dir():
            figures |= agreement(self.checkpoint)
        details = self._accuracy()
        for name, contenders in details.items():
            figures |= {
                _key(name, contender): values["miou_four"] for contender, values in contenders.items()
            }
        return Result(figures | _raf_means(details), {"iou": details})

    def _accuracy(self) -> dict[str, dict[str, dict[str, float]]]:
        """IoU by name of arena and lighting, contender and label."""
        config = DgcnnConfig(planes=PlanarVoteConfig() if self.vote else None, threads=THREADS)
        network = DgcnnClassifier(self.weights, config) if self.weights.exists() else None
        named = [(arena, self.frames) for arena in self.arenas if self.frames]
        rafs = [(str(path), self.raf_frames) for path in sorted(self.raf.glob("*.raf")) if self.raf_frames]
        jobs = [(*job, suffix) for suffix in LIGHTINGS for job in named + rafs]
        return {
            _name(arena) + suffix: accuracy(
                drive_through(arena, frames, self.seed, LIGHTINGS[suffix], KEYFRAMES), network
            )
            for arena, frames, suffix in track(jobs, "arenas", transient=True)
        }


def _name(arena: str) -> str:
    path = Path(arena)
    return f"raf.{path.stem}" if path.suffix == ".raf" else path.stem


def _key(name: str, contender: str) -> str:
    arena, dark, _ = name.partition(".dark")
    return f"miou_four.{arena}.{contender}{dark}"


def _raf_means(details: dict[str, Any]) -> dict[str, float]:
    """Means over all .raf files."""
    means = {}
    for suffix in LIGHTINGS:
        ours = [
            values
            for name, values in details.items()
            if name.startswith("raf.") and name.endswith(".dark") == bool(suffix)
        ]
        for contender in ours[0] if ours else ():
            means[f"miou_four.raf_mean.{contender}{suffix}"] = mean(v[contender]["miou_four"] for v in ours)
    return means
