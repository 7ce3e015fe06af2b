"""Clouds to train with, and the random blocks drawn from them."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.sampling import BlockSampler, augmented
from pipeline.semantic_map.networks.training_config import BlockAugmentation, TrainingConfig
from tests.pipeline.polygon_scene import floor, look, pose, wall

EYE = pose(0.5, 0.2, 0.6, 0.4, 0.2)


@pytest.fixture(scope="module")
def cloud():
    """A floor, and a little of a wall."""
    frame = look([floor(-5, 5, -5, 5), wall((2, -1), (2, 0.6), 0, 0.3)], EYE)
    return LabelledCloud.of(frame, EYE, 0.03)


CLEAR = BlockAugmentation(jitter=0, thinnest=1)
"""Blocks are turned and reflected, but not blurred or thinned."""


def sampler(clouds, blocks=4, augmentation=CLEAR):
    config = TrainingConfig(batch=blocks, seed=5, augmentation=augmentation)
    return BlockSampler(clouds, BlockConfig(), 20, config)


def test_a_cloud_counts_the_returns_of_every_class() -> None:
    frame = look([floor(-5, 5, -5, 5, label=Label.VICTIM)], EYE)
    frame.label[:240] = Label.UNLABELLED
    cloud = LabelledCloud.of(frame, EYE, 0.1)
    labelled = np.count_nonzero(frame.returns & (frame.label != Label.UNLABELLED))
    assert 0 < cloud.counts.sum() == cloud.counts[:, CLASSES.index(Label.CLUTTER)].sum() == labelled
    assert (cloud.counts.sum(axis=1) > 0).all()
    assert (cloud.camera == EYE[:3, 3]).all()


def test_a_frame_without_labels_is_refused() -> None:
    with pytest.raises(InputError, match="no true labels"):
        LabelledCloud.of(replace(look([floor(-1, 1, -1, 1)], EYE), label=None), EYE, 0.1)


def test_a_batch_is_a_function_of_its_number(cloud) -> None:
    one, same, other = sampler([cloud]).batch(7), sampler([cloud]).batch(7), sampler([cloud]).batch(8)
    assert one.sizes == same.sizes
    assert (one.points == same.points).all()
    assert one.sizes != other.sizes


def test_a_batch_has_blocks_with_the_channels_of_the_robots_own(cloud) -> None:
    batch = sampler([cloud]).batch(0)
    assert len(batch.sizes) == 4
    assert sum(batch.sizes) == len(batch.points) == len(batch.class_fractions)
    x, y, z, *normalized = batch.points.numpy().T
    assert np.abs(x).max() <= 0.5
    assert np.abs(y).max() <= 0.5
    assert z == pytest.approx(normalized[2] * 3.5 + 0.6, abs=1e-5)
    assert batch.class_fractions.sum(dim=1).numpy() == pytest.approx(np.ones(len(x)))


def test_every_cloud_has_its_turn() -> None:
    frames = [look([floor(-5, 5, -5, 5, z=-height)], EYE) for height in np.arange(8) / 10]
    drawn = sampler([LabelledCloud.of(frame, EYE, 0.1) for frame in frames])
    heights = [z for number in range(2) for z in np.unique(drawn.batch(number).points[:, 2].numpy().round(1))]
    assert sorted(heights) == pytest.approx((-np.arange(8) / 10)[::-1], abs=1e-6)


def test_rare_classes_are_drawn_more_often(cloud) -> None:
    def share(rare):
        shares = sampler([cloud], 40, replace(CLEAR, rare=rare)).batch(0).class_fractions
        return float(shares[:, CLASSES.index(Label.WALL)].mean())

    assert share(1.0) > 2 * share(0.0)


def test_augmentation_is_a_rigid_motion_about_the_vertical(cloud) -> None:
    points, camera = augmented(cloud, CLEAR, np.random.default_rng(1))
    assert points[:, 2] == pytest.approx(cloud.points[:, 2], abs=1e-6)
    before = np.linalg.norm(cloud.points - cloud.camera, axis=1)
    assert np.linalg.norm(points - camera, axis=1) == pytest.approx(before, abs=1e-5)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1) == pytest.approx(
        np.linalg.norm(np.diff(cloud.points, axis=0), axis=1), abs=1e-5
    )


def test_clouds_have_the_mean_colours_of_their_voxels_and_become_darker() -> None:
    frame = look([floor(-5, 5, -5, 5)], EYE)
    frame = replace(frame, rgb=np.broadcast_to(np.uint8([255, 51, 0]), (*frame.depth.shape, 3)))
    cloud = LabelledCloud.of(frame, EYE, 0.1, colours=True)
    assert cloud.points.shape == (len(cloud.counts), 6)
    assert cloud.points[:, 3:] == pytest.approx(np.tile([1, 0.2, 0], (len(cloud.points), 1)))
    light = [augmented(cloud, CLEAR, np.random.default_rng(seed))[0][:, 3:] for seed in range(60)]
    factors = np.array([colours[0, 0] for colours in light])
    assert all(colours == pytest.approx(f * cloud.points[:, 3:]) for f, colours in zip(factors, light, strict=True))
    assert 0.05 < (factors == 0).mean() < 0.4
    assert 0.9 < factors.max() <= 1
    assert sampler([cloud]).batch(0).points.shape[1] == 9


def test_points_are_dropped_and_small_blocks_filled_up(cloud) -> None:
    whole = sampler([cloud], blocks=30).batch(0)
    thinned = sampler([cloud], 30, replace(CLEAR, thinnest=0.3)).batch(0)
    assert 0.5 < sum(thinned.sizes) / sum(whole.sizes) < 0.8
    lonely = LabelledCloud(cloud.points[:1], cloud.counts[:1], cloud.camera)
    assert sampler([lonely]).batch(0).sizes == [20] * 4
