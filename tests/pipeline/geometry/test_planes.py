"""Least-squares planes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.geometry.planes import Moments, Plane, distances, facing_camera, planes_through, transform_planes
from pipeline.transforms import from_rotation, transform_points


def test_distance_is_positive_on_the_side_of_the_normal() -> None:
    plane = Plane(np.array([0.0, 0, 1]), 0.5)
    assert plane.distance(np.array([(0, 0, 2.0), (7, 7, 0)])).tolist() == [1.5, -0.5]


def test_facing_turns_the_normal_and_keeps_the_points() -> None:
    plane = Plane(np.array([0.0, 0, 1]), 0.5).facing(np.array([1.0, 0, -0.1]))
    assert plane.normal.tolist() == [0, 0, -1]
    assert plane.distance(np.array([(3, 3, 0.5)])).tolist() == [0]


def test_facing_the_camera_the_offset_is_not_positive() -> None:
    planes = facing_camera(np.array([(0, 0, 1.0, 2), (0, 0, -1, -2), (0, 1, 0, 0)]))
    assert planes.tolist() == [[0, 0, -1, -2], [0, 0, -1, -2], [0, 1, 0, 0]]


@given(st.integers(0, 2**32 - 1))
def test_fit_agrees_with_singular_values_and_moments_add_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = (rng.normal(0, [2, 1, 0.01], (50, 3)) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]) + rng.uniform(
        -20, 20, 3
    )
    plane, rms = (Moments.of(points[:20]) + Moments.of(points[20:])).fit(np.array([0.3, -0.5, 0.8]))
    centre = points.mean(axis=0)
    _, singular, axes = np.linalg.svd(points - centre)
    assert abs(plane.normal @ axes[2]) == pytest.approx(1, abs=1e-9)
    assert plane.distance(centre[None])[0] == pytest.approx(0, abs=1e-9)
    assert plane.normal @ (0.3, -0.5, 0.8) > 0
    assert rms == pytest.approx(singular[2] / np.sqrt(50), rel=1e-3)


@given(st.integers(0, 2**32 - 1))
def test_a_plane_through_three_points_holds_them(seed: int) -> None:
    triples = np.random.default_rng(seed).uniform(-5, 5, (20, 3, 3))
    planes = planes_through(triples)
    assert np.linalg.norm(planes[:, :3], axis=1) == pytest.approx(1)
    for points, plane in zip(triples, planes, strict=True):
        assert distances(points, plane) == pytest.approx(0, abs=1e-9)
        assert distances(points + plane[:3], planes)[:, (planes == plane).all(axis=1)] == pytest.approx(1)


@given(st.integers(0, 2**32 - 1))
def test_points_keep_their_distances_when_planes_move_with_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, planes = rng.uniform(-5, 5, (20, 3)), planes_through(rng.uniform(-5, 5, (4, 3, 3)))
    T = from_rotation(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-5, 5, 3))
    moved = distances(transform_points(T, points), transform_planes(T, planes))
    np.testing.assert_allclose(moved, distances(points, planes), atol=1e-6)


def test_no_plane_goes_through_three_points_on_a_line() -> None:
    assert np.isnan(planes_through(np.array([[(0.0, 0, 1), (0, 0, 2), (0, 0, 3)]]))).all()
