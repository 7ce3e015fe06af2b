"""Which way is up, by the floor or by all surfaces in view."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.localisation.vertical import T_floor_camera, T_lowest_camera, vertical
from pipeline.transforms import from_rotation, from_yaw
from tests.pipeline.localisation.driving_robot import ROOM, T_BASE_CAMERA, seen
from tests.pipeline.polygon_scene import floor, wall

HERE = from_yaw(1.2, 1.0, 0.0, 0.3)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Degrees between two directions."""
    return float(np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))))


@pytest.mark.parametrize("rolled", [-20, 0, 15])
def test_floor_and_walls_show_the_vertical(rolled: float) -> None:
    c, s = np.cos(np.deg2rad(rolled)), np.sin(np.deg2rad(rolled))
    T_world_base = HERE @ from_rotation(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.zeros(3))
    up = vertical(seen(T_world_base, T_world_base))
    assert up is not None
    assert angle(up, T_world_base[2, :3]) < 1


def test_without_a_floor_walls_and_a_table_do() -> None:
    faces = [wall((3, -2), (3, 2), -1, 2), wall((0, 1.7), (3, 1.7), -1, 2), floor(1.9, 2.9, -0.5, 1.6, z=0.2)]
    up = vertical(seen(HERE, HERE, faces=faces))
    assert up is not None
    assert angle(up, np.array([0, 0, 1])) < 1


def test_a_wall_alone_shows_nothing() -> None:
    assert vertical(seen(HERE, HERE, faces=[wall((2.5, -9), (2.5, 9), -5, 5)])) is None
    frame = seen(HERE, HERE)
    assert vertical(replace(frame, depth=np.zeros_like(frame.depth))) is None


def test_the_camera_is_level_over_the_lowest_in_view() -> None:
    frame = seen(HERE, HERE, faces=ROOM)
    T = T_lowest_camera(frame, T_BASE_CAMERA[2, :3])
    np.testing.assert_allclose(T[:3, :3], T_BASE_CAMERA[:3, :3], atol=1e-9)
    np.testing.assert_allclose(T[:3, 3], [0, 0, T_BASE_CAMERA[2, 3]], atol=0.02)


def test_the_floor_shows_how_a_camera_looks() -> None:
    T = T_floor_camera(seen(HERE, HERE))
    np.testing.assert_allclose(T[:3, :3], T_BASE_CAMERA[:3, :3], atol=0.01)
    np.testing.assert_allclose(T[:3, 3], [0, 0, 0.6], atol=0.01)


def test_infinite_depth_is_no_part_of_the_floor() -> None:
    frame = seen(HERE, HERE)
    hole = np.zeros(frame.depth.shape, np.bool_)
    hole[150:180, 100:200] = True
    alike = [T_floor_camera(replace(frame, depth=np.where(hole, empty, frame.depth))) for empty in (0, np.inf)]
    np.testing.assert_array_equal(*alike)


def test_a_table_is_no_floor() -> None:
    table = [floor(2.9, 3.6, 0.3, 1.6, z=0.3), wall((2.9, 0.3), (2.9, 1.6), 0.0, 0.3)]
    frame = seen(HERE, HERE, faces=[*ROOM, *table])
    np.testing.assert_allclose(T_floor_camera(frame)[2, 3], 0.6, atol=0.01)


def test_a_camera_that_sees_no_floor_gets_an_error() -> None:
    frame = seen(HERE, HERE)
    with pytest.raises(InputError, match="only 0 depths; it needs at least 100"):
        T_floor_camera(replace(frame, depth=np.zeros_like(frame.depth)))
    with pytest.raises(InputError, match="no floor"):
        T_floor_camera(replace(frame, depth=np.full_like(frame.depth, 2.0)))
