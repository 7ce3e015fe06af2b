"""A carried robot is found where the map leaves no doubt, and nowhere else."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.localisation.relocalisation import Relocalisation
from pipeline.transforms import from_yaw, inverse
from tests.pipeline.localisation.carried_robot import BARE, HALL, ROOM, WEST, Maps, on_ramp, room, seen, tour
from tests.pipeline.polygon_scene import Face
from tests.pipeline.robot_model import PIONEER

T_MAP_ODOM = from_yaw(2.0, -7.0, 0.0, 1.9)


def looking_around(faces: list[Face], T_map_base: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], Frame]]:
    """Poses and frames of a full turn in steps of 60°."""
    for n in range(6):
        T = T_map_base @ from_yaw(0, 0, 0, n * np.pi / 3)
        yield T, seen(faces, T, T_MAP_ODOM, seed=100 + n)


def find(maps: Maps, faces: list[Face], T_map_base: NDArray[np.float64]) -> tuple[NDArray | None, NDArray]:
    """The robot's pose as first found while it looks around, None if not found, and its true pose."""
    relocalisation = Relocalisation(PIONEER)
    for T, frame in looking_around(faces, T_map_base):
        relocalisation.add(frame)
        found = relocalisation.find(maps.metric_map, maps.elevation_map, maps.points)
        if found is not None:
            return found, T
    return None, T_map_base


@pytest.mark.parametrize("T_map_base", [from_yaw(1.2, 2.4, 0, 0.3), from_yaw(2.8, 1.1, 0, 1.0), on_ramp(2.5)])
def test_a_robot_finds_itself_anywhere_in_its_map(T_map_base: NDArray[np.float64]) -> None:
    found, T = find(room(), ROOM, T_map_base)
    assert found is not None
    error = inverse(T) @ found
    assert np.linalg.norm(error[:3, 3]) < 0.05
    assert np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1)) < np.deg2rad(2)


def test_a_room_that_looks_the_same_from_both_ends_leaves_doubt() -> None:
    maps = Maps().add(BARE, tour([(1, 1), (1, 3), (4, 1), (4, 3)]))
    assert find(maps, BARE, from_yaw(1.4, 1.2, 0, 0.4))[0] is None


def test_a_robot_is_not_found_in_the_map_of_another_arena() -> None:
    assert find(room(), HALL, from_yaw(2.0, 1.2, 0, 0.4))[0] is None


def test_a_robot_is_not_found_in_a_map_that_ends_before_it() -> None:
    maps = Maps().add(ROOM, tour(WEST))
    assert find(maps, ROOM, from_yaw(4.0, 2.9, 0, 1.0))[0] is None


def test_a_robot_that_sees_nothing_or_has_no_map_is_nowhere() -> None:
    frame, maps = seen(ROOM, from_yaw(0.5, 2.0, 0, np.pi)), room()
    assert frame.returns.sum() == 0
    relocalisation = Relocalisation(PIONEER)
    assert relocalisation.find(maps.metric_map, maps.elevation_map, maps.points) is None
    relocalisation.add(frame)
    assert relocalisation.find(maps.metric_map, maps.elevation_map, maps.points) is None
    relocalisation.add(seen(ROOM, from_yaw(0.5, 2.0, 0, 0.0)))
    empty = Maps()
    assert relocalisation.find(empty.metric_map, empty.elevation_map, np.zeros((0, 3), np.float32)) is None
