"""Normals and region growing, against linear algebra and by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.segments.regions_kernels import grow_regions, nearest_regions, normals, null_vector, smallest_eigenvalue
from pipeline.segments.surfels_kernels import NONE


@given(st.integers(0, 2**32 - 1))
def test_least_eigenvalue_and_its_vector_agree_with_lapack(seed: int) -> None:
    root = np.random.default_rng(seed).normal(size=(3, 3))
    matrix = root @ root.T
    values, vectors = np.linalg.eigh(matrix)
    least = smallest_eigenvalue(matrix)
    assert least == pytest.approx(values[0], abs=1e-9 * values[2])
    if values[1] - values[0] > 1e-3 * values[2]:
        vector = null_vector(matrix - least * np.eye(3))
        assert abs(vector @ vectors[:, 0]) == pytest.approx(1, abs=1e-6)


def grid(normal_of_column):
    """A strip of 5 × N points whose slope dz/dx changes by column, and its eight-neighbourhoods."""
    z = np.cumsum(normal_of_column) * 0.05
    points = np.array([(c * 0.05, r * 0.05, z[c]) for r in range(5) for c in range(len(z))], np.float32)
    near = np.full((len(points), 9), NONE, np.int32)
    for i, p in enumerate(points):
        others = [j for j, q in enumerate(points) if j != i and np.abs(p - q)[:2].max() < 0.06]
        near[i, : len(others)] = others
    return points, near


def test_normals_of_a_slope() -> None:
    points, near = grid([0.5] * 6)
    normal, variation = normals(points, near)
    expected = np.array([-0.5, 0, 1]) / np.hypot(0.5, 1)
    assert np.abs(normal @ expected) == pytest.approx(1)
    assert variation == pytest.approx(0, abs=1e-6)


def test_point_with_two_neighbours_has_no_normal() -> None:
    near = np.array([[1, 2, NONE], [0, NONE, NONE], [0, NONE, NONE]], np.int32)
    normal, variation = normals(np.eye(3, dtype=np.float32), near)
    assert not normal.any()
    assert (variation == 1).all()


def test_regions_end_at_an_edge_and_at_a_step() -> None:
    for slopes in ([0.0] * 6 + [1.0] * 6, [0.0] * 6 + [4.0] + [0.0] * 5):
        points, near = grid(slopes)
        normal, variation = normals(points, near)
        region = grow_regions(
            points, near, normal, np.argsort(variation, kind="stable"), np.cos(np.deg2rad(15)), 0.03
        ).reshape(5, 12)
        assert region[2, 1] == region[0, 4]
        assert region[2, 10] == region[4, 9]
        assert region[2, 1] != region[2, 10]


def test_gentle_bend_of_a_floor_is_one_region() -> None:
    points, near = grid([0.0] * 6 + [0.05] * 6)
    normal, _ = normals(points, near)
    assert not grow_regions(points, near, normal, np.arange(60), np.cos(np.deg2rad(15)), 0.03).any()


def test_points_go_to_the_nearest_plane_among_neighbours() -> None:
    points = np.array([(0, 0, 0.01), (0, 0, 0.08), (0, 0, 0.5)], np.float32)
    planes = np.array([(0, 0, 1.0, 0), (0, 0, 1, 0.1), (0, 0, 1, 0.5)])
    region = np.array([1, 0, NONE], np.int32)
    near = np.array([[1, NONE], [0, 2], [0, 1]], np.int32)
    claimed = nearest_regions(points, near, np.arange(3), region, planes, 0.05)
    # The third lies on plane 2, but none of its neighbours belongs to that plane.
    assert claimed.tolist() == [0, 1, NONE]
