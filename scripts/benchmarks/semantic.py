"""Speed and accuracy of the robot's semantic network, compared with plain DGCNN and rules without learning."""

import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import mean

import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.semantic_map.classifier import CLASSES, PointClassifier
from pipeline.semantic_map.networks.blocks import CHANNELS, Block, BlockConfig, cut
from pipeline.semantic_map.networks.classifier import NetworkClassifier, save_classifier
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.weights import load_weights
from pipeline.semantic_map.rules import RuleClassifier
from sarsim.commands.cli import tracked
from scripts.benchmarks.common import Result, check_at_least, wall_time_of
from scripts.benchmarks.labelled_drives import LIGHTINGS, SPARSE_KEYFRAMES, PosedFrame, drive_through, scores
from scripts.benchmarks.settings import ARENAS, SHARED, SemanticSettings

BLOCK_POINTS = 4096
THREADS = 2
TIMED_FRAMES = 10  # Number of timed frames, in nist_6x4
CHECKPOINT_FOLDER = SHARED / "dgcnn"
"""Folder of a published checkpoint and its logits; without it, agreement is not measured."""


def measure(settings: SemanticSettings) -> Result:
    """DGCNN's speed and agreement with a published checkpoint, and the network's accuracy in unseen arenas.

    Figures of missing files are left out.

    Raises:
        InputError: there is nothing to measure, or an arena or the weights are broken.
    """
    check_at_least(1, settings, "rounds")
    check_at_least(0, settings, "frames", "raf_frames")
    seed = settings.seed
    network = NetworkClassifier(settings.weights, threads=THREADS) if settings.weights.exists() else None
    figures = speed(list(drive_through("nist_6x4", TIMED_FRAMES, seed)), settings.rounds, network)
    if CHECKPOINT_FOLDER.is_dir():
        figures |= agreement(CHECKPOINT_FOLDER)
    # Accuracy in each arena, by the arena's name, in normal light and in the dark.
    arenas = {arena: (arena, settings.frames) for arena in ARENAS}
    arenas |= {f"raf.{path.stem}": (str(path), settings.raf_frames) for path in sorted(settings.raf.glob("*.raf"))}
    details = dict[str, dict[str, dict[str, float]]]()
    jobs = [(name, suffix) for suffix in LIGHTINGS for name, (_, frames) in arenas.items() if frames]
    for name, suffix in tracked(jobs, "arenas"):
        arena, frames = arenas[name]
        details[name + suffix] = accuracy(
            drive_through(arena, frames, seed, LIGHTINGS[suffix], SPARSE_KEYFRAMES), network
        )
    return Result(figures | accuracy_figures(details), {"iou": details})


def accuracy(frames: Iterable[PosedFrame], network: PointClassifier | None) -> dict[str, dict[str, float]]:
    """IoU by label, and ``miou_four``, of the network, its fused map and the baseline in one arena.

    Without a network, only the baseline is scored.
    """
    classifiers: dict[str, PointClassifier] = {"baseline": RuleClassifier()}
    if network is not None:
        classifiers["network"] = network
    reached = scores(frames, classifiers)
    scored = {name: of["frame"] for name, of in reached.items()}
    if network is not None:
        scored["fused"] = reached["network"]["fused"]
    return {name: score for name, score in scored.items() if score}


def accuracy_figures(details: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, float]:
    """``miou_four.<arena>.<contender>``, with the suffix ".dark" in the dark, and the means over all .raf arenas."""
    figures, rafs = dict[str, float](), dict[str, list[float]]()
    for name, contenders in details.items():
        arena, dark, _ = name.partition(".dark")
        for contender, values in contenders.items():
            figures[f"miou_four.{arena}.{contender}{dark}"] = values["miou_four"]
            if arena.startswith("raf."):
                rafs.setdefault(f"miou_four.raf_mean.{contender}{dark}", []).append(values["miou_four"])
    return figures | {name: mean(values) for name, values in rafs.items()}


def speed(frames: list[PosedFrame], rounds: int, classifier: NetworkClassifier | None) -> dict[str, float]:
    """Seconds per block and frame, and their ratios; DGCNN has random weights, which do not affect its time.

    DGCNN is timed on ``rounds`` blocks. Complete frames are timed only if the robot's ``classifier`` is given.
    """
    torch.manual_seed(0)
    network = Dgcnn(CHANNELS, len(CLASSES)).eval()
    blocks = [block for frame in frames for block in thesis_blocks(frame)]
    figures = _block_contest(network, [blocks[i % len(blocks)].points for i in range(rounds)])
    if classifier is not None:
        clouds = [(frame.frame, frame.points, frame.T_map_camera) for frame in frames]
        classifier.classify(*clouds[0])
        times = [wall_time_of(classifier.classify, *cloud) for cloud in clouds]
        figures["frame_s"] = float(np.median(times))
        figures["frame_s_worst"] = float(np.max(times))
    return figures


def agreement(folder: Path) -> dict[str, float]:
    """Fraction of points with the published network's class, and median absolute difference of the logits."""
    network, _ = load_weights(folder / "s3dis_area6.safetensors")
    fast = for_inference(network, THREADS)
    with np.load(folder / "reference.npz") as file:
        points, expected = file["input"], file["logits"]
    given = np.stack([fast(block.T).T for block in points])
    return {
        "checkpoint_agreement": float((given.argmax(axis=1) == expected.argmax(axis=1)).mean()),
        "checkpoint_logit_difference": float(np.median(np.abs(given - expected))),
    }


def thesis_blocks(frame: PosedFrame) -> list[Block]:
    """The columns of a frame as in the thesis, each subsampled or oversampled to 4,096 points."""
    points = frame.points
    config, rng = BlockConfig(points=len(points)), np.random.default_rng(0)
    columns = cut(points, frame.T_map_camera[:3, 3], config, 0.0, 1, rng)
    return [_resampled(column, rng) for column in columns]


def _resampled(column: Block, rng: np.random.Generator) -> Block:
    count = len(column.index)
    chosen = rng.permutation(count)[:BLOCK_POINTS]
    chosen = np.append(chosen, rng.choice(count, BLOCK_POINTS - len(chosen)))
    return Block(column.index[chosen], column.points[chosen])


def _block_contest(network: Dgcnn, blocks: list[NDArray[np.float32]]) -> dict[str, float]:
    fast = FastDgcnn(network, THREADS)
    fast(blocks[0])
    _plain(network, blocks[0])
    rows = [(wall_time_of(fast, block), wall_time_of(_plain, network, block)) for block in tracked(blocks, "blocks")]
    ours, theirs = np.array(rows).T
    return {
        "fast_vs_plain": float(np.median(theirs / ours)),
        "fast_block_s": float(np.median(ours)),
        "plain_block_s": float(np.median(theirs)),
    }


def classifier_of(network: PointNetwork) -> NetworkClassifier:
    """A network with random weights, as a classifier like the robot's."""
    with tempfile.TemporaryDirectory() as folder:
        weights = Path(folder) / "random.safetensors"
        save_classifier(weights, network, BlockConfig(), {})
        return NetworkClassifier(weights, threads=THREADS)


def _plain(network: PointNetwork, block: NDArray[np.float32]) -> NDArray[np.float32]:
    with torch.inference_mode():
        logits: torch.Tensor = network(torch.from_numpy(np.ascontiguousarray(block)), [len(block)])
        return logits.numpy()
