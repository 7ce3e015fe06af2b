import numpy as np
import pytest

from pipeline.navigation.recovery import backtrack, escape
from pipeline.transforms import from_yaw
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability, assess_map
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import flat, ground_points, ridge, surface_of, wall_points


def before_a_wall() -> Traversability:
    """Level ground with a wall at x = 0."""
    return assess_map(surface_of(ground_points(flat, (-3, 0), (-2, 2)), wall_points((0, -2), (0, 2))))


@pytest.mark.parametrize("yaw_deg", [0, 180])
def test_before_a_wall_it_leaves_straight_on_or_straight_back(yaw_deg):
    traversability = before_a_wall()
    out = escape(traversability, from_yaw(-0.325, 0.1, 0, np.deg2rad(yaw_deg)))
    assert traversability.grid.at(traversability.turnable, out)
    assert out[1] == pytest.approx(0.1)
    assert -0.6 < out[0] < -0.325


def test_where_it_can_turn_it_stays():
    for x in (-1.0, -PIONEER.corner_radius - 0.06):
        np.testing.assert_array_equal(escape(before_a_wall(), from_yaw(x, 0, 0, 0)), (x, 0))


def test_along_the_wall_no_way_leads_out():
    np.testing.assert_array_equal(escape(before_a_wall(), from_yaw(-0.325, 0, 0, np.pi / 2)), (-0.325, 0))


def test_a_robot_that_slid_too_near_to_a_wall_leaves_straight_back():
    traversability = before_a_wall()
    assert not traversability.grid.at(traversability.traversable, (-0.23, 0.1))
    out = escape(traversability, from_yaw(-0.23, 0.1, 0, 0))
    assert traversability.grid.at(traversability.turnable, out)
    assert -0.6 < out[0] < -0.23


def test_beside_a_wall_on_a_ramp_it_leaves_to_where_it_can_turn():
    ramp = assess_map(surface_of(ground_points(ridge, (-2, 2), (-0.3, 2)), wall_points((-2, -0.3), (2, -0.3))))
    out = escape(ramp, from_yaw(-0.3, 0.02, 0, np.pi / 2))
    assert ramp.grid.at(ramp.slidable, out)
    assert out[1] > 0.02


def test_a_robot_that_was_held_beside_a_wall_leaves_for_more_room_though_it_cannot_turn_there():
    walls = [wall_points((-2, y), (2, y)) for y in (-0.3, 0.6)]
    ramp = assess_map(surface_of(ground_points(ridge, (-2, 2), (-0.3, 0.6)), *walls))
    held = from_yaw(-0.5, 0.02, 0, np.deg2rad(210))
    np.testing.assert_array_equal(escape(ramp, held), (-0.5, 0.02))
    out = escape(ramp, held, was_held=True)
    assert not ramp.grid.at(ramp.turnable | ramp.slidable, out)
    assert ramp.grid.at(ramp.traversable, out)
    assert ramp.grid.at(ramp.to_hazard, out) > ramp.grid.at(ramp.to_hazard, (-0.5, 0.02)) + 0.05
    assert out[0] > -0.5  # backwards


def test_it_goes_back_as_it_came_where_the_map_says_that_it_could_not_have_come():
    shut = assess_map(
        surface_of(
            ground_points(flat, (-3, 3), (-1, 1)), wall_points((0.3, -1), (0.3, 1)), wall_points((1.6, -1), (1.6, 1))
        )
    )
    came = np.column_stack([np.linspace(-1.5, 0.9, 300), np.full(300, 0.1)])
    way = backtrack(ShortestPaths(shut, came[-1]), came)
    assert way is not None
    assert shut.grid.at(shut.turnable, way[-1])
    assert -0.3 < way[-1, 0] < 0.0  # the last such place before the wall
    np.testing.assert_allclose(np.abs(np.diff(way[:-1, 0])), 0.4, atol=0.02)
    assert 0.4 < way[0, 0] < 0.6


def test_it_stays_where_all_of_its_way_is_still_open():
    traversability = before_a_wall()
    came = np.array([(-2.0, 0.0), (-1.0, 0.0)])
    assert backtrack(ShortestPaths(traversability, came[-1]), came) is None
    assert backtrack(ShortestPaths(traversability, came[-1]), came[:0]) is None
