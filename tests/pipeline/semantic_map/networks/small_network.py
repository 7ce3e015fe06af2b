"""A network with weights as a training might leave them, and blocks to classify."""

import numpy as np
import torch
from torch import nn

from pipeline.semantic_map.networks.dgcnn import Dgcnn


def network(channels=6, classes=6, seed=0):
    """Random weights; batch norms with all kinds of means, variances, shifts and scales, also negative ones."""
    torch.manual_seed(seed)
    return with_random_norms(Dgcnn(channels, classes))


def with_random_norms(result):
    """A network in evaluation mode with batch norms as a training might leave them."""
    result.eval()
    for module in result.modules():
        if isinstance(module, nn.BatchNorm1d | nn.BatchNorm2d):
            nn.init.uniform_(module.weight, -1.5, 1.5)
            nn.init.uniform_(module.bias, -0.5, 0.5)
            nn.init.uniform_(module.running_mean, -0.3, 0.3)
            nn.init.uniform_(module.running_var, 0.5, 2)
    return in_half_precision(result)


def in_half_precision(result):
    """The network with its weights rounded as files round them."""
    for tensor in result.file_tensors().values():
        tensor.copy_(tensor.half())
    return result


def block(points, channels=6, seed=0):
    """(points, channels) float32 in a cube of 1 m."""
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (points, channels)).astype(np.float32)


def plain(dgcnn, points):
    """(N, classes) logits of the network as it is written."""
    with torch.inference_mode():
        return dgcnn(torch.from_numpy(points), [len(points)]).numpy()
