"""The network as one of the robot's point classifiers."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig, cut
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.weights import load_weights, save_weights
from pipeline.semantic_map.planar_vote import PlanarVoteConfig, planar_vote
from pipeline.semantic_map.voxels import VoxelCloud


@dataclass(frozen=True)
class DgcnnConfig:
    """Settings of the classifier; the size of blocks comes with the weights."""

    votes: int = 3
    """Grids of columns, each shifted against the others, over which class probabilities are averaged."""
    threads: int | None = None
    """One a processor if not given."""
    planes: PlanarVoteConfig | None = field(default_factory=PlanarVoteConfig)
    """How the points of a plane vote on what they are; without it every voxel is on its own."""
    seed: int = 0
    """Of where the grid lies in each frame, so that seams fall elsewhere, and of sampling."""


class DgcnnClassifier:
    """Classifies the points of a frame by DGCNN, every one of them."""

    def __init__(self, weights: Path, config: DgcnnConfig | None = None) -> None:
        """Load weights that ``train.py`` wrote.

        Raises:
            InputError: as of :func:`load_classifier`.
        """
        self.config = config or DgcnnConfig()
        network, self._blocks = load_classifier(weights)
        self._network = FastDgcnn(network, self.config.threads)

    def classify(
        self, frame: Frame, points: NDArray[np.float32], T_map_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """(N, 8) float32 class probabilities; what is not finite is unlabelled."""
        cloud = VoxelCloud.of(points, self._blocks.voxel_size)
        rng = np.random.default_rng([self.config.seed, int(np.float64(frame.time).view(np.uint64))])
        of_voxels = segment(
            self._network, cloud.points, T_map_camera[:3, 3], self._blocks, self.config.votes, rng
        )
        unknown = np.full((1, len(CLASSES)), 1 / len(CLASSES), np.float32)
        of_points = np.vstack([of_voxels, unknown])[cloud.voxel_of_point]
        if self.config.planes is not None:
            of_points = planar_vote(frame, T_map_camera, of_points, self.config.planes)
        probabilities = np.zeros((len(points), len(Label)), np.float32)
        probabilities[:, CLASSES] = of_points
        probabilities[cloud.voxel_of_point == len(cloud.points)] = np.eye(len(Label))[Label.UNLABELLED]
        return probabilities


def segment(
    network: FastDgcnn,
    points: NDArray[np.float32],
    camera: NDArray[np.floating],
    config: BlockConfig,
    votes: int,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """(M, classes) float32 probabilities of (M, 3) points, the mean over ``votes`` grids of columns."""
    result = np.zeros((len(points), network.classes), np.float32)
    start = rng.uniform()
    for vote in range(votes):
        shift = (start + vote / votes) * config.size
        for block in cut(points, camera, config, shift, network.k, rng):
            result[block.index] += softmax(network(block.points), axis=1) / votes
    return result


def load_classifier(path: Path) -> tuple[Dgcnn, BlockConfig]:
    """The network of a file that :func:`save_classifier` wrote, and how it wants clouds cut.

    Raises:
        InputError: as of :func:`load_weights`, or the network tells other classes apart or has other channels.
    """
    network, metadata = load_weights(path)
    return network, _block_config(path, network, metadata)


def save_classifier(path: Path, network: Dgcnn, blocks: BlockConfig, training: dict[str, object]) -> None:
    """Write weights, what :class:`DgcnnClassifier` must know of them, and how they were trained.

    Raises:
        InputError: the file cannot be written.
    """
    labels = ",".join(label.name.lower() for label in CLASSES)
    about = {"labels": labels, "blocks": json.dumps(asdict(blocks)), "training": json.dumps(training)}
    save_weights(path, network, about)


def _block_config(path: Path, network: Dgcnn, metadata: dict[str, str]) -> BlockConfig:
    labels = ",".join(label.name.lower() for label in CLASSES)
    if metadata.get("labels") != labels or network.classes != len(CLASSES):
        told = metadata.get("labels", f"{network.classes} unnamed classes")
        raise InputError(
            f"{path}: a network that tells apart {told}, not {labels}; train.py makes such a one"
        )
    if network.channels != 6:
        raise InputError(f"{path}: a network for {network.channels} channels a point, not 6")
    try:
        return BlockConfig(**json.loads(metadata["blocks"]))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: weights of another version: it does not say how to cut blocks") from error
