"""The thesis's comparison of networks: accuracy, size and time, with the same frames, planar vote and map."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import mean
from time import perf_counter

import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.arrays import Probabilities
from pipeline.errors import InputError
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.config import NetworkConfig
from pipeline.semantic_map.networks.blocks import CHANNELS
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.weights import NETWORKS, load_weights
from pipeline.semantic_map.planar_vote import vote_on_planes
from sarsim.commands.cli import tracked
from scripts.benchmarks.common import Result, check_at_least, wall_time_of
from scripts.benchmarks.labelled_drives import (
    KINDS,
    LIGHTINGS,
    SPARSE_KEYFRAMES,
    Change,
    PosedFrame,
    Scores,
    drive_through,
    scores,
)
from scripts.benchmarks.semantic import THREADS, classifier_of, thesis_blocks
from scripts.benchmarks.settings import ARENAS, NetworksSettings

TIMED_FRAMES = 5  # Number of timed frames, in nist_6x4
FIRST_RANDOM = 90_000
"""Seed of the first random arena.

Datasets draw the seeds of their arenas from a range of two billion, so that they hardly ever contain these arenas.
"""


def measure(settings: NetworksSettings) -> Result:
    """Size, time and accuracy of every network, in arenas on which no network was trained.

    Figures that need frames, .raf files or weights are left out if these are missing.

    Raises:
        InputError: there is nothing to measure, or an arena or weights are broken.
    """
    check_at_least(1, settings, "rounds")
    check_at_least(0, settings, "frames", "raf_frames", "random")
    if not settings.weights.is_dir():
        raise InputError(
            f"--weights {settings.weights}: must be a folder with weights files such as dgcnn.safetensors"
        )
    paths = {name: settings.weights / f"{name}.safetensors" for name in NETWORKS}
    files = {name: path for name, path in paths.items() if path.is_file()}
    # Size and time of all networks, on the frames of a drive.
    timed = list(drive_through("nist_6x4", TIMED_FRAMES, settings.seed))
    figures = _sizes(files) | _times(files, timed, settings.rounds)
    # Accuracy of the networks with weights, arena by arena, in normal light and in the dark.
    groups = frames_by_group(settings)
    lit = {suffix: value for suffix, value in LIGHTINGS.items() if settings.lighting in (None, value.name)}
    jobs = [(group, arena, suffix) for suffix in lit for group in groups for arena in groups[group]]
    networks = {name: NetworkClassifier(path, False, THREADS, name) for name, path in files.items()}
    details: dict[str, dict[str, Scores]] = {}
    for group, arena, suffix in tracked(jobs if networks else [], "arenas"):
        seen = drive_through(arena, groups[group][arena], settings.seed, lit[suffix], SPARSE_KEYFRAMES)
        details.setdefault(group + suffix, {})[arena] = scores(seen, networks, VOTES)
    # Figures: means over the arenas of each group.
    for group, of_arenas in details.items():
        figures |= group_figures(group, list(of_arenas.values()))
    return Result(figures, {"iou": details})


def frames_by_group(settings: NetworksSettings) -> dict[str, dict[str, int]]:
    """The number of frames of each arena to label, by group of figures; arenas without frames are left out."""
    groups = {Path(arena).stem: {arena: settings.frames} for arena in ARENAS}
    groups["raf_mean"] = {str(path): settings.raf_frames for path in sorted(settings.raf.glob("*.raf"))}
    of_random = settings.raf_frames or settings.frames
    groups["random_mean"] = {f"random:{FIRST_RANDOM + n}": of_random for n in range(settings.random)}
    return {group: {arena: n for arena, n in arenas.items() if n} for group, arenas in groups.items()}


def after_planar_vote(frame: PosedFrame, given: NDArray[np.float32]) -> Probabilities:
    """(N, 8) probabilities of a frame's points after the planar vote, from the ``given`` (N, 8) probabilities."""
    result = given.copy()
    result[:, CLASSES] = vote_on_planes(
        frame.frame, frame.T_map_camera, given[:, CLASSES], NetworkConfig().plane_weight
    )
    return result


VOTES: Mapping[str, Change] = {"": after_planar_vote, ".alone": lambda frame, given: given}
"""Changes to probabilities, with and without the planar vote, by suffix of the figures' names."""


def group_figures(group: str, of_arenas: Sequence[Scores]) -> dict[str, float]:
    """Means over the arenas of a group, whose name may end in ".dark"."""
    figures = {}
    place, dark, _ = group.partition(".dark")
    for contender in of_arenas[0]:
        name, alone, _ = contender.partition(".alone")
        for kind in KINDS:
            found = [of_arena[contender][kind] for of_arena in of_arenas]
            for score in sorted(set().union(*found)):
                what = score if score == "miou_four" else f"iou.{score}"
                values = [values[score] for values in found if score in values]
                figures[f"{name}.{what}.{place}.{kind}{alone}{dark}"] = mean(values)
    return figures


def _sizes(files: dict[str, Path]) -> dict[str, float]:
    """Number of parameters, and processor time of the training, s, if the weights file states it."""
    figures: dict[str, float] = {}
    for name, kind in NETWORKS.items():
        figures[f"{name}.parameters"] = sum(p.numel() for p in kind(CHANNELS, len(CLASSES)).parameters())
        if name in files:
            _, metadata = load_weights(files[name], name)
            with suppress(KeyError, TypeError, ValueError):  # Files of other programs do not state this time
                figures[f"{name}.train_s"] = float(json.loads(metadata["training"])["processor_s"])
    return figures


def _times(files: dict[str, Path], frames: list[PosedFrame], rounds: int) -> dict[str, float]:
    """Median times per block, ms, and per frame, s, including planes; networks without a file have random weights."""
    torch.manual_seed(0)
    written = {name: kind(CHANNELS, len(CLASSES)).eval() for name, kind in NETWORKS.items()}
    ready = {name: for_inference(network, THREADS) for name, network in written.items()}
    blocks = [block.points for frame in frames for block in thesis_blocks(frame)]
    times: dict[str, list[float]] = {}
    for turn in tracked(range(-1, rounds), "blocks"):
        for name, network in ready.items():
            block = [blocks[turn % len(blocks)]] * THREADS
            begin = perf_counter()
            list(network.of_blocks(block))
            took = (perf_counter() - begin) / THREADS
            times.setdefault(f"{name}.block_ms", []).extend([1000 * took] * (turn >= 0))
    classifiers = {
        name: NetworkClassifier(files[name], threads=THREADS) if name in files else classifier_of(network)
        for name, network in written.items()
    }
    for frame in frames:
        for name, classifier in classifiers.items():
            took = wall_time_of(classifier.classify, frame.frame, frame.points, frame.T_map_camera)
            times.setdefault(f"{name}.frame_s", []).append(took)
    return {name: float(np.median(values)) for name, values in times.items()}
