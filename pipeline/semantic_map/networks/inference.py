"""Makes a network ready for inference or for training."""

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
    """The network ready to classify on so many ``threads``, by default PyTorch's number."""
    if isinstance(network, Dgcnn):
        return FastDgcnn(network, threads)
    return AsWritten(cast(RowNetwork, network), threads)


def for_training(network: PointNetwork) -> nn.Module:
    """A module that shares the network's weights and takes points and sizes of blocks as :class:`RowNetwork` does."""
    return RaggedDgcnn(network) if isinstance(network, Dgcnn) else network


class AsWritten:
    """A network whose own forward pass is fast enough for inference."""

    def __init__(self, network: RowNetwork, threads: int | None = None) -> None:
        """Share the network: later changes of its weights take effect."""
        self._network, self._threads = network, threads or torch.get_num_threads()
        self._device = next(network.parameters()).device
        self.classes, self.fewest = network.classes, network.fewest

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, channels) float32 points to (N, classes) float32 logits.

        Raises:
            InputError: as :func:`check_block`.
        """
        check_block(self._network, points)
        was_training = self._network.training
        self._network.eval()
        with torch_threads(self._threads), torch.inference_mode():
            logits = self._network(torch.from_numpy(points).to(self._device), [len(points)])
        self._network.train(was_training)
        return cast(NDArray[np.float32], logits.cpu().numpy())
