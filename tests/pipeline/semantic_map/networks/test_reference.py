"""The published checkpoint gives the published logits, where it is at hand."""

import numpy as np
import pytest
import torch

from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.weights import load_weights


@pytest.fixture(scope="module")
def reference(shared):
    with np.load(shared / "dgcnn" / "reference.npz") as file:
        return file["input"], file["logits"]


@pytest.fixture(scope="module")
def network(shared):
    return load_weights(shared / "dgcnn" / "s3dis_area6.safetensors")[0]


def agree(logits, expected):
    assert (logits.argmax(axis=1) == expected.argmax(axis=1)).mean() >= 0.999
    assert np.median(np.abs(logits - expected)) < 1e-4


def test_the_network_as_written_answers_as_published(network, reference) -> None:
    points, expected = reference
    with torch.inference_mode():
        agree(np.stack([network(torch.from_numpy(block.T.copy()), [block.shape[1]]).T for block in points]), expected)


def test_the_fast_network_answers_as_published(network, reference) -> None:
    points, expected = reference
    fast = FastDgcnn(network, threads=2)
    agree(np.stack([fast(block.T).T for block in points]), expected)
