"""A network ready to classify on the CPU, and to be trained."""

from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.ragged import RaggedDgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.threads import torch_threads
from pipeline.semantic_map.networks.network import BlockClassifier, PointNetwork, RowNetwork, check_block


def for_inference(network: PointNetwork, threads: int | None = None) -> BlockClassifier:
    """The network ready to classify, with so many ``threads``; if not given, PyTorch's number (OMP_NUM_THREADS)."""
    if isinstance(network, Dgcnn):
        return FastDgcnn(network, threads)
    return AsWritten(cast(RowNetwork, network), threads)


def for_training(network: PointNetwork) -> nn.Module:
    """What takes (P, channels) points of blocks and their sizes, as :class:`RowNetwork`, and has the same weights."""
    return RaggedDgcnn(network) if isinstance(network, Dgcnn) else network


class AsWritten:
    """A network that is fast enough as it is written."""

    def __init__(self, network: RowNetwork, threads: int | None = None) -> None:
        """Use the weights that it has at each time."""
        self._network, self._threads = network, threads or torch.get_num_threads()
        self._device = next(network.parameters()).device
        self.classes, self.fewest = network.classes, network.fewest

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, channels) float32 points to (N, classes) float32 logits.

        Raises:
            InputError: as of :func:`check_block`.
        """
        check_block(self._network, points)
        was_training = self._network.training
        self._network.eval()
        with torch_threads(self._threads), torch.inference_mode():
            logits = self._network(torch.from_numpy(points).to(self._device), [len(points)])
        self._network.train(was_training)
        return cast(NDArray[np.float32], logits.cpu().numpy())
