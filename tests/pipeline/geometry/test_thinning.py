"""Thinned clouds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.geometry.thinning import VoxelCloud, first_in_voxels


def test_a_voxel_has_the_mean_of_its_points() -> None:
    points = np.float32([[0.01, 0.01, 0.01], [0.12, 0, 0], [0.03, 0.05, 0.09], [-0.01, 0, 0]])
    cloud = VoxelCloud.of(points, 0.1)
    assert cloud.points == pytest.approx(np.array([[-0.01, 0, 0], [0.02, 0.03, 0.05], [0.12, 0, 0]]), abs=1e-6)
    assert cloud.voxel_of_point.tolist() == [1, 2, 1, 0]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e9])
def test_points_that_are_nowhere_have_no_voxel(bad: float) -> None:
    points = np.float32([[0, 0, 0], [0, bad, 0], [1, 1, 1]])
    cloud = VoxelCloud.of(points, 0.1)
    assert len(cloud.points) == 2
    assert cloud.voxel_of_point.tolist() == [0, 2, 1]


def test_no_points_make_no_voxels() -> None:
    cloud = VoxelCloud.of(np.empty((0, 3), np.float32), 0.1)
    assert cloud.points.shape == (0, 3)
    assert cloud.points.dtype == np.float32
    assert cloud.voxel_of_point.shape == (0,)


@given(arrays(np.float32, st.tuples(st.integers(1, 60), st.just(3)), elements=st.floats(-2, 2, width=32)))
def test_points_share_a_voxel_if_their_cells_are_the_same(points: np.ndarray) -> None:
    cloud = VoxelCloud.of(points, 0.5)
    cells = np.floor(points * np.float32(2))
    same_cell = (cells[:, None] == cells[None]).all(axis=2)
    assert (same_cell == (cloud.voxel_of_point[:, None] == cloud.voxel_of_point[None])).all()
    assert len(cloud.points) == len(np.unique(cells, axis=0))


def test_voxels_may_be_boxes():
    points = np.float32([(0.01, 0.01, 0.01), (0.01, 0.01, 0.09), (0.03, 0.01, 0.01)])
    cloud = VoxelCloud.of(points, (0.02, 0.02, 0.1))
    np.testing.assert_allclose(cloud.points, [(0.01, 0.01, 0.05), (0.03, 0.01, 0.01)], atol=1e-7)
    assert cloud.hits.tolist() == [2, 1]


@given(arrays(np.float32, st.tuples(st.integers(0, 60), st.just(3)), elements=st.floats(-2, 2, width=32)))
def test_the_first_point_of_each_voxel_is_kept_in_order(points: np.ndarray) -> None:
    kept, seen = [], set()
    for n, point in enumerate(points):
        cell = tuple(np.floor(point * np.float32(3)))
        kept += [] if cell in seen else [n]
        seen.add(cell)
    assert first_in_voxels(points, 3).tolist() == kept


def test_double_precision_is_kept() -> None:
    points = np.array([(0, 0, 1 - 1e-12), (0, 0, 1.0), (0, 0, 1.5)])
    assert first_in_voxels(points).tolist() == [0, 1]


def test_points_that_are_nowhere_are_not_kept() -> None:
    assert first_in_voxels(np.float32([(np.nan, 0, 0), (0, 0, 0), (1e9, 0, 0)])).tolist() == [1]
