"""Prepare trained networks for inference."""

from collections.abc import Iterable, Iterator
from copy import deepcopy
from itertools import chain, pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils.fusion import fuse_linear_bn_eval

from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.network import BlockClassifier, PointNetwork, check_block
from pipeline.semantic_map.networks.threads import Threads


def for_inference(network: PointNetwork, threads: int | None = None) -> BlockClassifier:
    """The network, prepared to classify on ``threads`` threads, by default as many as PyTorch uses."""
    if isinstance(network, Dgcnn):
        return FastDgcnn(deepcopy(network).cpu(), threads)
    return TorchBlockClassifier(network, threads)


class TorchBlockClassifier:
    """A network whose own forward pass is fast enough for inference."""

    def __init__(self, network: PointNetwork, threads: int | None = None) -> None:
        """Copy the network and fold its batch norms into the layers before them."""
        network.penalty = 0.0  # the graph of the last training step's penalty cannot be copied
        self._network, self._threads = deepcopy(network).eval(), Threads(threads or torch.get_num_threads())
        for layers in self._network.modules():
            if isinstance(layers, nn.Sequential):
                _fold_batch_norms(layers)
        self._device = next(network.parameters()).device
        self.classes, self.min_points = network.classes, network.min_points

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, classes) float32 logits of (N, channels) float32 points.

        Raises:
            InputError: see :func:`check_block`.
        """
        return next(self.of_blocks([points]))

    def of_blocks(self, blocks: Iterable[NDArray[np.float32]]) -> Iterator[NDArray[np.float32]]:
        """The logits of every block; each thread computes several blocks at once."""
        return chain.from_iterable(self._threads.each(_grouped(blocks), self._logits))

    def _logits(self, blocks: list[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
        for points in blocks:
            check_block(self._network, points)
        sizes = list(map(len, blocks))
        logits = self._network(torch.from_numpy(np.concatenate(blocks)).to(self._device), sizes)
        return np.split(logits.cpu().numpy(), np.cumsum(sizes)[:-1])


def _grouped(blocks: Iterable[NDArray[np.float32]]) -> Iterator[list[NDArray[np.float32]]]:
    """Group successive blocks, so that each group has at least as many points as a single block may have.

    With fewer points at once, threads wait for Python's global interpreter lock; many more points do not fit into the
    cache.
    """
    some: list[NDArray[np.float32]] = []
    for block in blocks:
        some.append(block)
        if sum(map(len, some)) >= BlockConfig.points:
            yield some
            some = []
    if some:
        yield some


def _fold_batch_norms(layers: nn.Sequential) -> None:
    """Fold batch norms into the linear maps before them."""
    for place, (layer, after) in enumerate(pairwise(layers)):
        if isinstance(layer, nn.Linear) and isinstance(after, nn.BatchNorm1d):
            layers[place], layers[place + 1] = fuse_linear_bn_eval(layer, after), nn.Identity()
