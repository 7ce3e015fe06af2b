"""A place found again among old surfaces, from where the robot wrongly believes to be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.places import find_place
from pipeline.localisation.registration import Surfaces
from pipeline.transforms import from_yaw, transform_points, yaw_of
from tests.pipeline.worlds import wall_points

SIGMAS = np.array([0.3, 0.3, np.deg2rad(2)])


def surfaces(*walls: tuple[tuple[float, float], tuple[float, float]]) -> Surfaces:
    """Walls from one place to another, seen from their left."""
    at, facing = [], []
    for start, end in walls:
        points = wall_points(start, end)
        along = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
        at.append(points)
        facing.append(np.tile([-along[1], along[0], 0.0], (len(points), 1)))
    return Surfaces(np.vstack(at).astype(np.float64), np.vstack(facing))


CORNER = surfaces(((-2, -1), (2, -1)), ((2, -1), (2, 2)), ((2, 2), (0.5, 2)))
CORRIDOR = surfaces(((-9, -1), (9, -1)), ((9, 1), (-9, 1)))


def moved(what: Surfaces, T: NDArray[np.float64]) -> Surfaces:
    return Surfaces(transform_points(T, what.at), what.facing @ T[:3, :3].T)


@settings(max_examples=15, deadline=None)
@given(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(-4, 4))
def test_a_corner_is_found_wherever_the_robot_believes_to_be(x: float, y: float, degrees: float) -> None:
    T = from_yaw(x, y, 0, np.deg2rad(degrees))
    place = find_place(moved(CORNER, T), CORNER, T, SIGMAS)
    assert place is not None
    left = place.T_move @ T
    assert np.linalg.norm(left[:2, 3]) < 0.15
    assert abs(yaw_of(left)) < np.deg2rad(3)
    assert place.fit > 0.6


def test_along_a_corridor_other_places_fit_as_well() -> None:
    T = from_yaw(0.3, 0.1, 0, 0)
    near = np.abs(CORRIDOR.at[:, 0]) < 4
    here = Surfaces(CORRIDOR.at[near], CORRIDOR.facing[near])
    place = find_place(moved(here, T), CORRIDOR, T, SIGMAS)
    assert place is not None
    assert place.rival > 0.95 * place.fit


@pytest.mark.parametrize("height", [0.0, 2.0])
def test_the_storey_above_is_another_place(height: float) -> None:
    above = Surfaces(CORNER.at + np.array([0.0, 0.0, height]), CORNER.facing)
    place = find_place(CORNER, above, np.eye(4), SIGMAS)
    assert place is not None
    assert (place.fit > 0.9) == (height == 0)


def test_a_bare_floor_is_no_place() -> None:
    points = np.random.default_rng(0).uniform((-3, -3, 0), (3, 3, 0.001), (2000, 3))
    floor = Surfaces(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))
    assert find_place(floor, floor, np.eye(4), SIGMAS) is None
