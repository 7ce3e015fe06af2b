"""The semantic map: speed and accuracy of the robot's network, against plain DGCNN and a baseline."""

from pathlib import Path
from statistics import mean
from typing import Any

from pipeline.semantic_map.networks.classifier import NetworkClassifier
from sarsim.commands.cli import tracked
from sarsim.sensors.lighting import Lighting
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.labelled_drives import drive_through
from scripts.benchmarks.semantic_accuracy import accuracy
from scripts.benchmarks.semantic_confusion import confusion
from scripts.benchmarks.semantic_speed import THREADS, agreement, speed
from scripts.benchmarks.settings import SemanticSettings

LIGHTINGS = {"": Lighting.normal, ".dark": Lighting.dark}  # By suffix of the figures' names
SPARSE_KEYFRAMES = (2.0, 0.8)
"""m and rad between the frames that are compared: far apart, so that they show more than an arena's start."""


def measure(settings: SemanticSettings) -> Result:
    """DGCNN's speed and agreement with a published checkpoint, and the network's accuracy in unseen arenas.

    Figures of missing files are left out. If an episode's folder is given, only the confusion of its map is measured.

    Raises:
        InputError: there is nothing to measure, or an arena, the weights or the episode are broken.
    """
    if settings.confusion is not None:
        return confusion(settings.confusion)
    at_least(1, settings, "rounds", "timed_frames")
    at_least(0, settings, "frames", "raf_frames")
    weights, seed = settings.weights, settings.seed
    network = NetworkClassifier(weights, threads=THREADS) if weights.exists() else None
    figures = speed(list(drive_through("nist_6x4", settings.timed_frames, seed)), settings.rounds, network)
    if settings.checkpoint.is_dir():
        figures |= agreement(settings.checkpoint)
    jobs = [(arena, settings.frames) for arena in settings.arenas if settings.frames]
    jobs += [(str(path), settings.raf_frames) for path in sorted(settings.raf.glob("*.raf")) if settings.raf_frames]
    lit = [(*job, suffix) for suffix in LIGHTINGS for job in jobs]
    details = {
        _name(arena) + suffix: accuracy(
            drive_through(arena, number, seed, LIGHTINGS[suffix], SPARSE_KEYFRAMES), network
        )
        for arena, number, suffix in tracked(lit, "arenas")
    }
    for name, contenders in details.items():
        figures |= {key(name, contender): values["miou_four"] for contender, values in contenders.items()}
    return Result(figures | raf_means(details), {"iou": details})


def _name(arena: str) -> str:
    path = Path(arena)
    return f"raf.{path.stem}" if path.suffix == ".raf" else path.stem


def key(name: str, contender: str) -> str:
    """The name of a figure, given an arena's name with or without ".dark"."""
    arena, dark, _ = name.partition(".dark")
    return f"miou_four.{arena}.{contender}{dark}"


def raf_means(details: dict[str, Any]) -> dict[str, float]:
    """Means over all .raf arenas, by contender and lighting."""
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
