"""Which way is up, by the floor."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.localisation.floor import T_floor_camera
from pipeline.transforms import from_yaw
from tests.pipeline.localisation.driving_robot import ROOM, T_BASE_CAMERA, seen
from tests.pipeline.polygon_scene import floor, wall

HERE = from_yaw(1.2, 1.0, 0.0, 0.3)


def test_the_floor_tells_how_a_camera_looks() -> None:
    T = T_floor_camera(seen(HERE, HERE))
    np.testing.assert_allclose(T[:3, :3], T_BASE_CAMERA[:3, :3], atol=0.01)
    np.testing.assert_allclose(T[:3, 3], [0, 0, 0.6], atol=0.01)


def test_a_table_is_no_floor() -> None:
    table = [floor(2.9, 3.6, 0.3, 1.6, z=0.3), wall((2.9, 0.3), (2.9, 1.6), 0.0, 0.3)]
    frame = seen(HERE, HERE, faces=[*ROOM, *table])
    np.testing.assert_allclose(T_floor_camera(frame)[2, 3], 0.6, atol=0.01)


def test_a_camera_that_sees_no_floor_is_told_so() -> None:
    frame = seen(HERE, HERE)
    with pytest.raises(InputError, match="shows too little to tell which way is up"):
        T_floor_camera(replace(frame, depth=np.zeros_like(frame.depth)))
    with pytest.raises(InputError, match="shows no floor"):
        T_floor_camera(replace(frame, depth=np.full_like(frame.depth, 2.0)))
