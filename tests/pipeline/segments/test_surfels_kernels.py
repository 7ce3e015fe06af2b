"""Thinning a frame, and putting pixels back onto planes."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.segments.surfels_kernels import NONE, make_surfels, neighbours, project_pixels
from tests.pipeline.polygon_scene import CAMERA, floor, look, pose, wall

AHEAD = pose(0, 0, 0.6, 0.0)


def surfels_of(frame):
    labels = frame.label * frame.returns
    return make_surfels(frame.depth, labels, CAMERA.rays, 8, 16, 0.01, 5.0)


def test_surfels_lie_on_the_surface_and_average_the_noise_away() -> None:
    points, labels, blocks, of_pixel = surfels_of(look([wall((2, 3), (2, -3), -1, 3)], AHEAD, sigma=0.01))
    assert len(points) == 80 * 60
    assert (labels == Label.WALL).all()
    assert np.abs(points[:, 2] - 2).max() < 5 * 0.01 / 8
    assert (np.diff(blocks[:, 0] * 80 + blocks[:, 1]) > 0).all()
    assert (np.bincount(of_pixel.ravel()) == 64).all()


def test_labels_in_one_block_are_kept_apart() -> None:
    frame = look([wall((2, 3), (2, -3), -1, 3)], AHEAD)
    frame.label[:, 324:] = Label.CEILING
    _, labels, blocks, of_pixel = surfels_of(frame)
    shared = blocks[:, 1] == 40
    assert sorted(set(labels[shared])) == [Label.WALL, Label.CEILING]
    assert labels[of_pixel[0, 323]] == Label.WALL
    assert labels[of_pixel[0, 324]] == Label.CEILING


def test_surfaces_one_before_the_other_are_parted_and_a_slanted_one_is_not() -> None:
    # The near wall ends inside the image block of column 40.
    two = look([wall((2, 3), (2, -0.01), -1, 3), wall((3, 3), (3, -3), -1, 3)], AHEAD)
    points, _, blocks, _ = surfels_of(two)
    assert sorted(points[blocks[:, 1] == 40][:2, 2].round(4)) == [2, 3]
    _, _, blocks, _ = surfels_of(look([floor(0, 5, -5, 5)], pose(0, 0, 0.6, 0, 0.3)))
    assert len(np.unique(blocks, axis=0)) == len(blocks)


def test_few_pixels_make_no_surfel() -> None:
    frame = look([wall((2, 3), (2, -3), -1, 3)], AHEAD)
    frame.label[:] = 0
    frame.label[:3, :5] = Label.WALL
    points, _, _, of_pixel = surfels_of(frame)
    assert len(points) == 0
    assert (of_pixel == NONE).all()


def test_neighbours_share_label_and_surface() -> None:
    points = np.array([(0, 0, 2), (0.1, 0, 2), (0.2, 0, 2.5), (0.3, 0, 2)], np.float32)
    blocks = np.array([(0, 0), (0, 1), (0, 2), (1, 0)], np.int32)
    labels = np.array([1, 1, 1, 2], np.uint8)
    near = neighbours(blocks, 3, labels, points, 2, 0.12)
    assert [sorted(row[row != NONE]) for row in near] == [[1], [0], [], []]


@pytest.mark.parametrize("sigma", [0.0, 0.01])
def test_projected_pixels_lie_on_the_plane_where_they_were_seen(sigma: float) -> None:
    frame = look([wall((2, 1), (2, -1), 0.2, 1.2)], AHEAD, sigma=sigma)
    points, labels, blocks, of_pixel = surfels_of(frame)
    near = neighbours(blocks, 81, labels, points, 2, 0.12)
    region = np.zeros(len(points), np.int32)
    on_plane, plane, surfel = project_pixels(
        frame.depth, CAMERA.rays, np.eye(4), of_pixel, near, region, np.array([[0, 0, 1.0, 2]]), 2, 0.05, 0.0
    )
    assert on_plane[:, 2] == pytest.approx(2, abs=1e-6)
    assert on_plane.min(axis=0) == pytest.approx([-1, -0.6, 2], abs=0.008)
    assert on_plane.max(axis=0) == pytest.approx([1, 0.4, 2], abs=0.008)
    assert not plane.any()
    assert np.abs(on_plane[:, :2] - points[surfel, :2]).max() < 8 / 577 * 2
