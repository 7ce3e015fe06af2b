"""Hulls and bounding boxes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.geometry.planes import Plane
from pipeline.segments.boxes import Hull, OrientedBox, bounding_box, corners


def rectangle(centre, x, y, length, width, n=400, seed=0):
    """Points of a rectangle with sides along the unit vectors x and y, its corners included."""
    ends = np.array([(s, t) for s in (-0.5, 0.5) for t in (-0.5, 0.5)])
    st = np.vstack([np.random.default_rng(seed).uniform(-0.5, 0.5, (n, 2)), ends]) * [length, width]
    return (np.asarray(centre) + st[:, :1] * np.asarray(x) + st[:, 1:] * np.asarray(y)).astype(np.float32)


def box_of(points, normal):
    centre = points.mean(axis=0).astype(float)
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    return bounding_box(Plane(normal, float(normal @ centre)), centre, Hull.of(points), 0.02, 0.05)


def is_rotation(R):
    return np.allclose(R @ R.T, np.eye(3)) and np.isclose(np.linalg.det(R), 1)


def test_corners_of_a_turned_box() -> None:
    T = np.eye(4)
    T[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T[:3, 3] = 1, 2, 3
    found = corners(OrientedBox(T, np.array([4.0, 2, 0.2])))
    assert found[0] == pytest.approx([2, 0, 2.9])
    assert found[-1] == pytest.approx([0, 4, 3.1])
    assert found.shape == (8, 3)


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.0, 2.2])
def test_wall(yaw: float) -> None:
    along, normal = np.array([np.cos(yaw), np.sin(yaw), 0]), np.array([-np.sin(yaw), np.cos(yaw), 0])
    box = box_of(rectangle((20, -7, 0.6), along, (0, 0, 1), 3.0, 1.2), normal)
    assert box.extent == pytest.approx([3.0, 1.2, 0.02], abs=1e-3)
    assert box.T_map_box[:3, 3] == pytest.approx([20, -7, 0.6], abs=1e-3)
    assert box.T_map_box[:3, 1] == pytest.approx([0, 0, 1])
    assert box.T_map_box[:3, 2] == pytest.approx(normal)
    assert is_rotation(box.T_map_box[:3, :3])


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.0, -1.5])
def test_inclined_ramp_has_y_up_the_slope(yaw: float) -> None:
    slope, along = np.deg2rad(16), np.array([np.cos(yaw), np.sin(yaw), 0])
    up = along * np.cos(slope) + [0, 0, np.sin(slope)]
    across = np.array([-along[1], along[0], 0])
    box = box_of(rectangle((5, 5, 0.1), across, up, 1.2, 0.6), np.cross(up, across) * -1)
    assert box.extent == pytest.approx([1.2, 0.6, 0.02], abs=0.01)
    assert box.T_map_box[:3, 1] == pytest.approx(up, abs=1e-6)
    assert is_rotation(box.T_map_box[:3, :3])


@pytest.mark.parametrize("degrees", [0, 20, 45, 77.5])
@pytest.mark.parametrize("up", [1, -1])
def test_level_box_is_the_least_rectangle(degrees: float, up: int) -> None:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    box = box_of(rectangle((3, 1, 0.17), (c, s, 0), (-s, c, 0), 2.4, 1.2), (0, 0, up))
    assert sorted(box.extent) == pytest.approx([0.02, 1.2, 2.4], abs=0.025)
    assert box.T_map_box[:3, 3] == pytest.approx([3, 1, 0.17], abs=0.01)
    assert is_rotation(box.T_map_box[:3, :3])


def test_nearly_aligned_level_box_keeps_the_axes_of_the_map() -> None:
    c, s = np.cos(0.01), np.sin(0.01)
    box = box_of(rectangle((0, 0, 0), (c, s, 0), (-s, c, 0), 2.0, 2.0), (0, 0, 1))
    assert box.T_map_box[:3, :3] == pytest.approx(np.eye(3))


@given(st.permutations(range(5)), st.floats(-np.pi, np.pi), st.floats(0.0, 1.5))
def test_union_box_of_a_plane_does_not_depend_on_the_order_and_only_grows(order, azimuth, tilt) -> None:
    normal = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    plane = Plane(normal, 0.0)
    x = np.cross(normal, (0.3, 0.5, 0.8))
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    hulls = [Hull.of(rectangle(np.sin(i) * x + np.cos(3 * i) * y, x, y, 1, 0.5, seed=i, n=20)) for i in range(5)]
    union, shuffled = hulls[0], hulls[order[0]]
    for i in range(1, 5):
        before = union.support
        union = union.union(hulls[i])
        assert (union.support >= before).all()
        shuffled = shuffled.union(hulls[order[i]])
    one, other = (bounding_box(plane, np.zeros(3), hull, 0.02, 0.05) for hull in (union, shuffled))
    assert np.array_equal(one.extent, other.extent)
    assert np.array_equal(one.T_map_box, other.T_map_box)


@given(st.integers(0, 2**32 - 1))
def test_box_holds_all_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    points = rng.uniform(-1, 1, (30, 3))
    points -= np.outer(points @ normal, normal)
    box = box_of(points.astype(np.float32), normal)
    inside = (points - box.T_map_box[:3, 3]) @ box.T_map_box[:3, :3]
    # Directions are rounded to a degree.
    assert (np.abs(inside) <= box.extent / 2 + 1.5 * np.deg2rad(0.6)).all()
