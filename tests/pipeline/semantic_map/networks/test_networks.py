"""The networks of the comparison: as their papers have them, on blocks of any size, in files and in training."""

from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn.functional import cross_entropy

from pipeline.errors import InputError
from pipeline.semantic_map.networks.classifier import load_classifier
from pipeline.semantic_map.networks.dgcnn import nearest
from pipeline.semantic_map.networks.inference import for_inference
from pipeline.semantic_map.networks.pointcnn import XConv, dense
from pipeline.semantic_map.networks.pointnet import PENALTY, PointNet
from pipeline.semantic_map.networks.pointnet2 import PointNet2
from pipeline.semantic_map.networks.pointnext import PointNeXt
from pipeline.semantic_map.networks.weights import NETWORKS, load_weights, save_weights
from tests.pipeline.semantic_map.networks import by_hand
from tests.pipeline.semantic_map.networks.small_network import in_half_precision, with_random_norms

OURS = sorted(NETWORKS)
NEW = [name for name in OURS if name != "dgcnn"]
"""All but DGCNN, which finds other neighbours in features that are rounded otherwise."""


def made(name, channels=6, classes=6):
    """A network of one's own; others are made once and stay as they are."""
    return deepcopy(built(name, channels, classes))


@cache
def built(name, channels=6, classes=6):
    torch.manual_seed(0)
    network = with_random_norms(NETWORKS[name](channels, classes))
    if name == "pointnet":  # whose transforms begin as the identity
        for net in (network.turn, network.transform):
            torch.nn.init.normal_(net.matrix.weight, std=0.02)
    return fitted(network)


def fitted(network):
    """The network, its batch norms fitted to some blocks as by a training: else answers fade layer by layer."""
    norms = [m for m in network.modules() if isinstance(m, torch.nn.BatchNorm1d | torch.nn.BatchNorm2d)]
    for norm in norms:
        norm.momentum = 1.0
    blocks = [corner(90 + 10 * seed, seed + 5)[:, : network.channels] for seed in range(4)]
    blocks = [np.column_stack([b, np.ones((len(b), network.channels - b.shape[1]), np.float32)]) for b in blocks]
    logits(network.train(), *blocks)
    for norm in norms:
        norm.momentum = 0.1
        assert norm.running_var is not None
        norm.running_var.add_(1e-3)
    return network.eval()


def corner(points, seed=0):
    """(points, 6) float32 of a floor and a wall, dense enough for more than 32 in a ball of 0.1 m."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 0.3, (points, 3))
    xyz[::2, 2], xyz[1::2, 0] = 0.0, 0.3
    xyz += rng.normal(0, 0.004, xyz.shape)
    return np.concatenate([xyz, (xyz - [1.5, 0.4, 0.6]) / 3.5], axis=1).astype(np.float32)


def logits(network, *blocks):
    with torch.inference_mode():
        rows = torch.from_numpy(np.concatenate(blocks))
        return network(rows, [len(block) for block in blocks]).numpy()


# As published


@pytest.mark.parametrize("name", OURS)
def test_what_classifies_keeps_its_weights_while_the_network_goes_on_learning(name):
    network, points = made(name), corner(90)
    fast = for_inference(network, 1)
    before = fast(points)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(2)
    np.testing.assert_array_equal(fast(points), before)


@pytest.mark.parametrize(
    ("name", "points", "written"),
    [
        ("pointnet", 60, by_hand.pointnet),
        ("pointnet2", 150, by_hand.pointnet2),
        ("pointnext", 150, by_hand.pointnext),
        ("pointcnn", 80, by_hand.pointcnn),
        ("dgcnn", 20, by_hand.dgcnn),
    ],
)
def test_a_network_answers_as_its_equations_do(name, points, written):
    network, x = made(name), corner(points)
    expected = written(by_hand.weights_of(network), x.astype(np.float64))
    assert expected.std(axis=0).min() > 1e-3
    np.testing.assert_allclose(logits(network, x), expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max())


def count(*modules):
    return sum(parameter.numel() for module in modules for parameter in module.parameters())


def test_pointnet_has_the_papers_3_5_million():
    network = PointNet(3, 40)
    trunk = count(network.turn, network.points1, network.transform, network.points2)
    classification = 1024 * 512 + 2 * 512 + 512 * 256 + 2 * 256 + 256 * 40 + 40  # figure 2's head for ModelNet40
    assert (trunk + classification) / 1e6 == pytest.approx(3.5, abs=0.05)
    assert count(PointNet(9, 13)) / 1e6 == pytest.approx(3.5, abs=0.05)


def test_pointnet2_has_the_parameters_of_the_published_code():
    network = PointNet2(9, 13)
    normed = sum(len(m.weight) for m in network.modules() if isinstance(m, torch.nn.BatchNorm1d))
    assert count(network) + normed == 968_269  # with the biases before batch norms, which change nothing


def test_pointnext_has_the_parameters_of_its_papers_settings():
    assert count(PointNeXt(4, 13)) == 792_237  # "0.792 M" with colours and height, 13 classes


def test_pointcnn_has_the_papers_0_6_million():
    # Classification of ModelNet40 (modelnet_x3_l4), the paper's table of parameters; points have no features.
    levels = [(8, 0, 24, 48, 4), (12, 48, 12, 96, 2), (16, 96, 24, 192, 2), (16, 192, 48, 384, 2)]
    convolutions = [XConv(k, 1, channels, lifted, out, depth) for k, channels, lifted, out, depth in levels]
    head = [dense(384, 384), dense(384, 192), torch.nn.Linear(192, 40)]
    assert count(*convolutions, *head) / 1e6 == pytest.approx(0.6, abs=0.05)


def test_pointnets_penalty_is_that_of_its_feature_transform():
    network, x = made("pointnet"), corner(50)
    logits(network, x)
    w = by_hand.weights_of(network)
    turned = x[:, :3].astype(np.float64) @ by_hand.transform(w, "turn", x.astype(np.float64), 3)
    local = by_hand.mlp(w, "points1", np.column_stack([turned, x[:, 3:]]))
    matrix = by_hand.transform(w, "transform", local, 64)
    expected = PENALTY * np.square(np.eye(64) - matrix @ matrix.T).sum()
    assert float(network.penalty) == pytest.approx(expected, rel=1e-3)


# Blocks


@pytest.mark.parametrize("name", NEW)
def test_blocks_together_get_what_each_gets_alone(name):
    network, one, other = made(name), corner(90), corner(41, seed=1)
    together = logits(network, one, other)
    alone = np.concatenate([logits(network, one), logits(network, other)])
    np.testing.assert_allclose(together, alone, atol=1e-4 * np.abs(alone).max())


def test_dgcnns_neighbours_are_the_nearest_of_the_same_block():
    blocks = [corner(50)[:, :3], corner(70, seed=1)[:, :3]]
    found = nearest(torch.from_numpy(np.concatenate(blocks)), [50, 70], 20).numpy()
    for block, start, rows in ((blocks[0], 0, found[:50]), (blocks[1], 50, found[50:])):
        distance = np.linalg.norm(block[:, None].astype(np.float64) - block, axis=2)
        assert (np.sort(rows, axis=1) == np.sort(distance.argsort(axis=1)[:, :20], axis=1) + start).all()


@pytest.mark.parametrize("name", NEW)
def test_the_order_of_points_does_not_matter(name):
    network, x = made(name), corner(120)
    order = np.random.default_rng(2).permutation(len(x))
    expected = logits(network, x)[order]
    np.testing.assert_allclose(logits(network, x[order]), expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", NEW)
def test_tiny_blocks_get_answers(name):
    fast = for_inference(made(name), threads=1)
    for points in (1, 2, 5):
        answer = fast(corner(points))
        assert answer.shape == (points, 6)
        assert np.isfinite(answer).all()


@pytest.mark.parametrize("name", NEW)
def test_inference_gives_the_answers_of_the_network_as_written(name):
    network, blocks = made(name), [corner(100 + 30 * seed, seed) for seed in range(3)]
    answers = list(for_inference(network, threads=2).of_blocks(blocks))
    for answer, block in zip(answers, blocks, strict=True):
        expected = logits(network, block)
        np.testing.assert_allclose(answer, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", OURS)
def test_blocks_of_another_shape_and_points_that_are_nowhere_are_refused(name):
    fast, x = for_inference(made(name), threads=1), corner(30)
    for shape in ((0, 6), (30, 9), (30,)):
        with pytest.raises(InputError, match=f"{name}: "):
            fast(np.zeros(shape, np.float32))
    x[3, 1] = np.nan
    with pytest.raises(InputError, match="finite"):
        fast(x)


# Learning


@pytest.mark.parametrize("name", OURS)
def test_every_parameter_learns(name):
    network = made(name).train()
    blocks = [corner(90), corner(70, seed=1)]
    given = network(torch.from_numpy(np.concatenate(blocks)), [90, 70])
    (cross_entropy(given, torch.arange(160) % 6) + network.penalty).backward()
    still = [
        n for n, p in network.named_parameters() if p.grad is None or not p.grad.isfinite().all() or not p.grad.any()
    ]
    assert still == []


# Files


@pytest.mark.parametrize("name", OURS)
def test_what_was_saved_is_loaded(name, tmp_path: Path) -> None:
    path, original = tmp_path / "w.safetensors", made(name, channels=9, classes=13)
    x = np.random.default_rng(0).uniform(0, 0.3, (60, 9)).astype(np.float32)
    expected = logits(original, x)
    save_weights(path, original)
    loaded, metadata = load_weights(path, name)
    assert (loaded.channels, loaded.classes, metadata["network"]) == (9, 13, name)
    assert not loaded.training
    assert (logits(loaded, x) == logits(in_half_precision(original), x)).all()
    if name in NEW:
        assert np.abs(logits(loaded, x) - expected).max() < 0.02 * np.abs(expected).max()


def test_all_five_fit_into_20_mb(tmp_path: Path) -> None:
    for name in OURS:
        save_weights(tmp_path / name, NETWORKS[name](6, 6))
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 20e6


@pytest.mark.parametrize("name", OURS)
def test_weights_of_another_network_are_refused(name, tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_weights(path, made(name))
    (other, *_) = (n for n in OURS if n != name)
    with pytest.raises(InputError, match=f"'{name}', .*{other}"):
        load_weights(path, other)
    save_weights(path, made(name), {"network": other})
    with pytest.raises(InputError, match=r"weights do not fit the network|not a DGCNN|the number of channels of"):
        load_weights(path)


@pytest.mark.parametrize(
    ("metadata", "complaint"),
    [
        ({"network": "transformer"}, "weights of 'transformer', but must contain those of pointnet, .* or "),
        ({"channels": "9"}, "weights do not fit the network .*has shape .* but must have"),
        ({"classes": "13"}, "weights do not fit the network .*has shape .* but must have"),
        *(
            ({"channels": text}, "number of channels of pointnext must be .* from 4 to 64, not")
            for text in ("", "0", "65", "9" * 99)
        ),
        ({"classes": "0"}, "number of classes of pointnext must be .* from 1 to 64, not '0'"),
    ],
)
def test_metadata_that_does_not_fit_is_refused(metadata: dict, complaint: str, tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", made("pointnext"), metadata)
    with pytest.raises(InputError, match=complaint):
        load_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"channels": 7}, "7 input channels"),
        ({"classes": 4}, "w.safetensors.* 4 outputs, but must have 6.*wall,terrain"),
    ],
)
def test_other_channels_and_classes_are_refused(changes: dict, complaint: str, tmp_path: Path) -> None:
    labels = "wall,terrain,inclined_ramp,straight_ramp,ceiling,clutter"
    save_weights(tmp_path / "w.safetensors", made("pointnext", **changes), {"labels": labels, "blocks": "{}"})
    with pytest.raises(InputError, match=complaint):
        load_classifier(tmp_path / "w.safetensors")
