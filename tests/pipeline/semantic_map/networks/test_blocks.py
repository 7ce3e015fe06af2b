"""Columns of clouds, and the channels of their points."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import CLASS_OF_LABEL, NO_CLASS, BlockConfig, channels, cut

CAMERA = np.array([1.0, 2.0, 0.6])


def cloud(count, seed=0):
    return np.random.default_rng(seed).uniform([-2, -1, 0], [1.5, 2, 1.2], (count, 3)).astype(np.float32)


def blocks(points, config=None, shift=0.0, min_points=20, seed=0):
    return list(cut(points, CAMERA, config or BlockConfig(), shift, min_points, np.random.default_rng(seed)))


def test_channels_are_relative_to_block_and_camera() -> None:
    points = np.float32([[3.75, -1.25, 0.2]])
    config = BlockConfig(reach=2.0)
    assert channels(points, np.array([3.5, -1.5]), CAMERA, config) == pytest.approx(
        np.array([[0.25, 0.25, 0.2, 1.375, -1.625, -0.2]])
    )


def test_colours_come_between_both_kinds_of_coordinates() -> None:
    points, config = cloud(4), BlockConfig()
    plain = channels(points, np.zeros(2), CAMERA, config)
    nine = channels(np.hstack([points, np.full((4, 3), 0.25, np.float32)]), np.zeros(2), CAMERA, config)
    assert (nine[:, 3:6] == 0.25).all()
    assert (nine[:, [0, 1, 2, 6, 7, 8]] == plain).all()


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_every_point_is_in_one_column(shift: float) -> None:
    points = cloud(3000)
    found = blocks(points, shift=shift)
    index = np.concatenate([block.index for block in found])
    assert sorted(index) == list(range(3000))
    for block in found:
        assert (np.abs(block.points[:, :2]) <= 0.5 + 1e-6).all()
        columns = np.floor(points[block.index, :2] - np.float32(shift))
        assert (columns == columns[0]).all()
        assert block.points.dtype == np.float32


def test_a_column_with_too_many_points_is_dealt_out() -> None:
    points = cloud(1000) % np.float32(1)
    found = blocks(points, BlockConfig(points=300))
    assert [len(block.index) for block in found] == [250] * 4
    assert sorted(np.concatenate([block.index for block in found])) == list(range(1000))
    # At random: each part spreads over the whole column.
    assert all(np.ptp(block.points[:, :3], axis=0).min() > 0.9 for block in found)


@pytest.mark.parametrize("count", [1, 7, 19])
def test_a_column_with_too_few_points_is_filled_up_with_them(count: int) -> None:
    (found,) = blocks(cloud(count) % np.float32(1))
    assert len(found.index) == len(found.points) == 20
    assert set(found.index) == set(range(count))


def test_the_same_numbers_give_the_same_blocks() -> None:
    config = BlockConfig(points=30)
    one, other, third = (blocks(cloud(900), config), blocks(cloud(900), config), blocks(cloud(900), config, seed=1))
    assert all((a.index == b.index).all() for a, b in zip(one, other, strict=True))
    assert any((a.index != b.index).any() for a, b in zip(one, third, strict=True))


def test_no_points_make_no_blocks() -> None:
    assert blocks(np.empty((0, 3), np.float32)) == []


def test_victims_are_clutter_and_what_is_unlabelled_has_no_class() -> None:
    assert [CLASS_OF_LABEL[label] for label in CLASSES] == list(range(6))
    assert CLASSES[CLASS_OF_LABEL[Label.VICTIM]] == Label.CLUTTER
    assert CLASS_OF_LABEL[Label.UNLABELLED] == NO_CLASS
