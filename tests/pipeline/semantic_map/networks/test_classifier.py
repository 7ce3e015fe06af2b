"""The network as the robot uses it; its weights are random."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from scipy.special import softmax

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.geometry.thinning import VoxelCloud
from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig, cut
from pipeline.semantic_map.networks.classifier import NetworkClassifier, save_classifier, segment
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from pipeline.semantic_map.networks.weights import save_weights
from pipeline.semantic_map.planar_vote import vote_on_planes
from tests.pipeline.polygon_scene import HALF, floor, look, pose, wall
from tests.pipeline.semantic_map.networks.small_network import network, plain

EYE = pose(0.5, 0.2, 0.6, 0.4, 0.2)
FRAME = look([floor(-5, 5, -5, 5), wall((2, -1), (2, 0.6), 0, 0.9)], EYE, camera=HALF)
BLOCKS = BlockConfig(voxel_size=0.05)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "w.safetensors"
    save_classifier(path, network(), BLOCKS, {"steps": 3})
    return path


def classifier(weights, vote=True):
    return NetworkClassifier(weights, vote, threads=2)


def test_every_point_gets_probabilities_of_the_networks_classes(weights: Path) -> None:
    points = FRAME.points(EYE)
    probabilities = classifier(weights).classify(FRAME, points, EYE)
    assert probabilities.shape == (len(points), len(Label))
    assert probabilities.dtype == np.float32
    assert probabilities.sum(axis=1) == pytest.approx(np.ones(len(points)), abs=1e-5)
    assert probabilities[:, CLASSES].any(axis=0).all()
    assert (probabilities[:, [Label.UNLABELLED, Label.VICTIM]] == 0).all()


def test_points_of_a_voxel_share_what_the_network_says_of_their_mean(weights: Path) -> None:
    points = FRAME.points(EYE)
    probabilities = classifier(weights, vote=False).classify(FRAME, points, EYE)
    cloud = VoxelCloud.of(points, BLOCKS.voxel_size)
    first = np.unique(cloud.voxel_of_point, return_index=True)[1]
    assert (probabilities == probabilities[first][cloud.voxel_of_point]).all()


def test_the_points_of_a_plane_vote(weights: Path) -> None:
    points = FRAME.points(EYE)
    own = classifier(weights, vote=False).classify(FRAME, points, EYE)
    voted = classifier(weights).classify(FRAME, points, EYE)[:, CLASSES]
    assert voted == pytest.approx(vote_on_planes(FRAME, EYE, own[:, CLASSES], 2.0))
    assert (voted != own[:, CLASSES]).any()


def test_the_same_frame_gets_the_same_answer_whatever_came_before(weights: Path) -> None:
    points = FRAME.points(EYE)
    one = classifier(weights)
    before = one.classify(FRAME, points, EYE)
    other_time = one.classify(replace(FRAME, time=1.5), points, EYE)
    assert (before == one.classify(FRAME, points, EYE)).all()
    assert (before != other_time).any()  # the grid lies elsewhere


def test_votes_are_averaged() -> None:
    points, camera = VoxelCloud.of(FRAME.points(EYE), 0.1).points, EYE[:3, 3]
    fast, config = FastDgcnn(network(), threads=1), BlockConfig(voxel_size=0.1)

    both = segment(fast, points, camera, config, 2, np.random.default_rng(4))
    start = np.random.default_rng(4).uniform()
    grids = [list(cut(points, camera, config, start + half, 20, np.random.default_rng(0))) for half in (0, 0.5)]
    expected = np.zeros_like(both)
    for block in grids[0] + grids[1]:
        expected[block.index] += softmax(fast(block.points), axis=1) / 2
    # Columns that are filled up at random are left out.
    full = np.all([np.isin(np.arange(len(points)), whole_columns(grid)) for grid in grids], axis=0)
    assert full.sum() > 500
    assert both[full] == pytest.approx(expected[full], abs=1e-6)


def whole_columns(blocks):
    """Indices of the points in columns that needed no filling up."""
    return np.concatenate([block.index for block in blocks if len(np.unique(block.index)) == len(block.index)])


def test_a_block_is_classified_as_by_the_network_as_written() -> None:
    points = np.random.default_rng(0).uniform([0, 0, 0], [1, 1, 1], (400, 3)).astype(np.float32)
    camera = np.array([0.2, 0.3, 0.6])
    rng = np.random.default_rng(0)
    config = BlockConfig(size=10)
    probabilities = segment(FastDgcnn(network(), threads=1), points, camera, config, 1, rng)
    shift = 10 * np.random.default_rng(0).uniform()
    centre = np.floor((points[0, :2] - shift) / 10) * 10 + 5 + shift
    block = np.column_stack([points - [*centre, 0], (points - camera) / 3.5]).astype(np.float32)
    odds = np.exp(plain(network(), block))
    assert probabilities == pytest.approx(odds / odds.sum(axis=1, keepdims=True), abs=1e-3)


@pytest.mark.parametrize("count", [0, 1, 25])
def test_tiny_clouds_get_probabilities(weights: Path, count: int) -> None:
    frame = replace(FRAME, depth=np.zeros_like(FRAME.depth))
    frame.depth[150, 50 : 50 + count] = 1.5
    probabilities = classifier(weights).classify(frame, frame.points(EYE), EYE)
    assert probabilities.shape == (count, len(Label))
    assert probabilities.sum(axis=1) == pytest.approx(np.ones(count), abs=1e-5)


def test_millions_of_returns_are_classified(weights: Path) -> None:
    intrinsics = Intrinsics(1500, 1400, 1200.0, 1200.0, 750.0, 700.0)
    depth = np.full((1400, 1500), 2.0, np.float32)
    frame = replace(FRAME, depth=depth, rgb=np.zeros((*depth.shape, 3), np.uint8), intrinsics=intrinsics)
    probabilities = classifier(weights).classify(frame, frame.points(EYE), EYE)
    assert len(probabilities) == 2_100_000
    assert probabilities[::1000].sum(axis=1) == pytest.approx(np.ones(2100), abs=1e-5)


def test_points_that_are_nowhere_are_unlabelled(weights: Path) -> None:
    points = FRAME.points(EYE)
    points[5], points[9, 1] = np.nan, np.inf
    labels = classifier(weights).classify(FRAME, points, EYE).argmax(axis=1)
    assert np.flatnonzero(labels == Label.UNLABELLED).tolist() == [5, 9]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"labels": "wall,terrain"}, "wall,terrain, but must predict"),
        ({"labels": None}, "6 unnamed classes"),
        ({"blocks": None}, "block settings .* missing or invalid"),
        ({"blocks": '{"colour": 3}'}, "block settings .* missing or invalid"),
        ({"blocks": "[" * 100_000}, "block settings .* missing or invalid"),
        ({"blocks": '{"size": "wide"}'}, "block settings .* missing or invalid"),
        ({"blocks": '{"voxel_size": 0}'}, "voxel_size = 0: must be from .* to .*; train"),
        ({"blocks": '{"size": 1e-9}'}, "size = 1e-09: must be from .* to .*; train"),
        ({"blocks": '{"reach": Infinity}'}, "reach = inf: must be from .* to .*; train"),
    ],
)
def test_weights_for_something_else_are_refused(tmp_path: Path, changes: dict, complaint: str) -> None:
    labels = ",".join(label.name.lower() for label in CLASSES)
    metadata = {"labels": labels, "blocks": "{}"} | changes
    save_weights(tmp_path / "w.safetensors", network(), {k: v for k, v in metadata.items() if v is not None})
    with pytest.raises(InputError, match=complaint):
        NetworkClassifier(tmp_path / "w.safetensors")


def test_weights_that_answer_with_no_numbers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "w.safetensors"
    save_classifier(path, network(), BLOCKS, {})
    with safe_open(path, "pt") as file:
        metadata = file.metadata()
    save_file({name: 1e12 * tensor.float() for name, tensor in load_file(path).items()}, path, metadata)
    with pytest.raises(InputError, match="finite"):
        classifier(path).classify(FRAME, FRAME.points(EYE), EYE)


def test_a_network_of_nine_channels_sees_colours(tmp_path: Path) -> None:
    save_classifier(tmp_path / "w.safetensors", network(channels=9), BLOCKS, {})
    points, loaded = FRAME.points(EYE), classifier(tmp_path / "w.safetensors", vote=False)
    black, grey = (replace(FRAME, rgb=np.full((*FRAME.depth.shape, 3), value, np.uint8)) for value in (0, 128))
    by_colour = [loaded.classify(frame, points, EYE) for frame in (black, grey, black)]
    assert (by_colour[0] == by_colour[2]).all()
    assert np.abs(by_colour[0] - by_colour[1]).max() > 1e-6


def test_eight_channels_are_refused(tmp_path: Path) -> None:
    save_classifier(tmp_path / "w.safetensors", network(channels=8), BLOCKS, {})
    with pytest.raises(InputError, match="8 input channels per point, but must have 6, or 9"):
        NetworkClassifier(tmp_path / "w.safetensors")
