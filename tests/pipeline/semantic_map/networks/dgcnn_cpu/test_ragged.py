"""Training's forward and backward pass against automatic differentiation of the network as it is written."""

import copy

import numpy as np
import pytest
import torch
from torch.nn.functional import cross_entropy

from pipeline.semantic_map.networks import dgcnn as written
from pipeline.semantic_map.networks.dgcnn_cpu import ragged
from pipeline.semantic_map.networks.dgcnn_cpu.ragged import RaggedDgcnn
from tests.pipeline.semantic_map.networks.small_network import block, network

POINTS = 60


@pytest.fixture
def batch():
    """Two blocks of the same size, so that the network as written can take them at once, and classes."""
    points = torch.from_numpy(np.concatenate([block(POINTS, seed=1), block(POINTS, seed=2)]))
    return points, torch.from_numpy(np.random.default_rng(3).integers(0, 6, 2 * POINTS))


def trainable(seed):
    dgcnn = network(seed=seed).train()
    dgcnn.dropout.p = 0
    return dgcnn


def step(dgcnn, logits, classes):
    """Gradients of a loss, by the parameters' names."""
    cross_entropy(logits, classes).backward()
    return {name: parameter.grad for name, parameter in dgcnn.named_parameters()}


def plainly(dgcnn, points):
    logits = dgcnn(points.view(2, POINTS, -1).transpose(1, 2))
    return logits.transpose(1, 2).flatten(end_dim=1)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("anywhere", [False, True])
def test_logits_gradients_and_statistics_are_those_of_the_network_as_written(
    seed: int, anywhere: bool, batch, monkeypatch: pytest.MonkeyPatch
) -> None:
    points, classes = batch
    ours = trainable(seed)
    theirs = copy.deepcopy(ours)
    graphs, find = [], ragged.neighbours

    def remember(x, sizes, k):
        graphs.append(find(x, sizes, k))
        return graphs[-1]

    def recall(x, k):
        return graphs.pop(0).view(2, POINTS, k).long() - POINTS * torch.arange(2)[:, None, None]

    # Rounding may choose other neighbours, so both get the same ones; the choice is tested by itself.
    with monkeypatch.context() as patch:
        patch.setattr(ragged, "neighbours", remember)
        patch.setattr(ragged, "on_cpu", lambda x: not anywhere)
        logits = RaggedDgcnn(ours)(points, [POINTS, POINTS])
        ours_gradients = step(ours, logits, classes)
    monkeypatch.setattr(written, "nearest", recall)
    expected = plainly(theirs, points)
    assert (logits - expected).abs().max() < 1e-4
    for name, gradient in step(theirs, expected, classes).items():
        error = (ours_gradients[name] - gradient).norm() / gradient.norm()
        assert error < 1e-3, name
    for name, buffer in theirs.named_buffers():
        if "running" in name:
            assert torch.allclose(ours.get_buffer(name), buffer, atol=1e-5), name


def test_blocks_do_not_see_each_other(batch) -> None:
    points, _ = batch
    found = ragged.neighbours(points[:, 3:].contiguous(), [50, 70], 20)
    assert ((found < 50) == (torch.arange(120) < 50)[:, None]).all()
