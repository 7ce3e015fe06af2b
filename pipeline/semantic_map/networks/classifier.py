"""A point classifier for the robot that uses a network."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from pipeline.arrays import Place, Points, Pose, Probabilities
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.geometry.thinning import VoxelCloud
from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES, PointClassifier
from pipeline.semantic_map.config import NetworkConfig
from pipeline.semantic_map.networks.blocks import CHANNELS, COLOURED, BlockConfig, coloured, cut
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.network import BlockClassifier, PointNetwork
from pipeline.semantic_map.networks.weights import load_weights, save_weights
from pipeline.semantic_map.planar_vote import vote_on_planes

MAX_FACTOR = 16
"""Maximum factor between the settings in a file's :class:`BlockConfig` and the defaults; with a larger factor, a
frame could take hours or all memory."""
_CLASS_NAMES = ",".join(label.name.lower() for label in CLASSES)


class NetworkClassifier(PointClassifier):
    """Classifies every point of a frame with a network."""

    def __init__(
        self,
        weights: Path,
        vote: bool = True,
        threads: int | None = None,
        network: str | None = None,
        *,
        config: NetworkConfig = NetworkConfig(),
    ) -> None:
        """Load weights written by ``sarsim-train``.

        Args:
            weights: the file.
            vote: whether the points of a plane vote on their classes; if not, every voxel is classified on its own.
            threads: number of threads; see :func:`for_inference` for the default.
            network: name of the only accepted network; by default, every network is accepted.
            config: parameters of the grids and the vote.

        Raises:
            InputError: see :func:`load_classifier`.
        """
        self._config = config
        written, self._blocks = load_classifier(weights, network)
        self._network, self._vote = for_inference(written, threads), vote
        self._has_colours = written.channels == COLOURED

    def classify(self, frame: Frame, points: Points, T_map_camera: Pose) -> Probabilities:
        """Class probabilities; points that are not finite are unlabelled."""
        cloud = VoxelCloud.of(points, self._blocks.voxel_size)
        # Sampling and grid positions differ between frames, so that the seams between blocks differ, too.
        rng = np.random.default_rng([0, int(np.float64(frame.time).view(np.uint64))])
        seen = coloured(cloud, frame.rgb[frame.returns]) if self._has_colours else cloud.points
        of_voxels = segment(self._network, seen, T_map_camera[:3, 3], self._blocks, self._config.grids, rng)
        unknown = np.full((1, len(CLASSES)), 1 / len(CLASSES), np.float32)
        of_points = np.vstack([of_voxels, unknown])[cloud.voxel_of_point]
        if self._vote:
            of_points = vote_on_planes(frame, T_map_camera, of_points, self._config.plane_weight)
        probabilities = np.zeros((len(points), len(Label)), np.float32)
        probabilities[:, CLASSES] = of_points
        probabilities[cloud.voxel_of_point == len(cloud.points)] = np.eye(len(Label))[Label.UNLABELLED]
        return probabilities


def segment(
    network: BlockClassifier,
    points: NDArray[np.float32],
    camera: Place,
    config: BlockConfig,
    grids: int,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """(M, classes) float32 probabilities, averaged over ``grids`` grids of columns; arguments as for :func:`cut`.

    Raises:
        InputError: the network rejects a block, or its logits are not finite.
    """
    result = np.zeros((len(points), network.classes), np.float32)
    start = rng.uniform()
    shifts = [(start + grid / grids) * config.size for grid in range(grids)]
    blocks = [block for shift in shifts for block in cut(points, camera, config, shift, network.min_points, rng)]
    for block, logits in zip(blocks, network.of_blocks(b.points for b in blocks), strict=True):
        if not np.isfinite(logits).all():
            raise InputError(
                "the network's outputs are not finite; use other --weights or, in training, lower --learning-rate"
            )
        result[block.index] += softmax(logits, axis=1) / grids
    return result


def load_classifier(path: Path, only: str | None = None) -> tuple[PointNetwork, BlockConfig]:
    """The network in a file of :func:`save_classifier`, and its block settings; ``only`` names the accepted network.

    Raises:
        InputError: see :func:`load_weights`; or the network has the wrong classes or channels, or its block settings
            are missing or too far from the defaults.
    """
    network, metadata = load_weights(path, only)
    remedy = f"; train a network with 'sarsim-train {network.NAME}'"
    if (named := metadata.get("labels", f"{network.classes} unnamed classes")) != _CLASS_NAMES:
        raise InputError(f"{path}: the network predicts {named}, but must predict {_CLASS_NAMES}{remedy}")
    if network.classes != len(CLASSES):
        raise InputError(
            f"{path}: the network has {network.classes} outputs, but must have {len(CLASSES)}, "
            f"one for each of {_CLASS_NAMES}{remedy}"
        )
    if network.channels not in (CHANNELS, COLOURED):
        raise InputError(
            f"{path}: the network has {network.channels} input channels per point, "
            f"but must have {CHANNELS}, or {COLOURED} with colours{remedy}"
        )
    try:
        blocks = BlockConfig(**json.loads(metadata["blocks"]))
        for name, usual in asdict(BlockConfig()).items():
            least, most = usual / MAX_FACTOR, usual * MAX_FACTOR
            if not least <= getattr(blocks, name) <= most:
                raise InputError(
                    f"{path}: block setting {name} = {getattr(blocks, name)}: must be from {least:g} to {most:g}"
                    f"{remedy}"
                )
        return network, replace(blocks, points=int(blocks.points))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: the block settings in the metadata are missing or invalid{remedy}") from error


def save_classifier(path: Path, network: PointNetwork, blocks: BlockConfig, training: dict[str, object]) -> None:
    """Write weights, the metadata that :class:`NetworkClassifier` needs, and a record of the ``training``.

    Raises:
        InputError: see :func:`save_weights`.
    """
    about = {"labels": _CLASS_NAMES, "blocks": json.dumps(asdict(blocks)), "training": json.dumps(training)}
    save_weights(path, network, about)
