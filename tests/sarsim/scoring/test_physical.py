"""The least time for a way, worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarsim.robots.model import drive_model
from sarsim.scoring.physical import Drive, least_seconds

BODY = replace(drive_model(), top_speed=1.0, top_turn_rate=2.0, acceleration=0.5)
"""Reaches its speed in 2 s and 1 m."""


def drive(*stops, backwards=None, first=0.0, last=0.0):
    back = np.zeros(len(stops) - 1, np.bool_) if backwards is None else np.array(backwards)
    return Drive(np.array(stops, np.float64), back, first, last)


def test_a_straight_way_is_accelerated_on_and_not_braked_at_its_end():
    assert least_seconds([drive((0, 0), (5, 0))], BODY) == pytest.approx(2 + 4)
    assert least_seconds([drive((0, 0), (0.25, 0))], BODY) == pytest.approx(1)


def test_viewpoints_and_corners_are_passed_without_a_stop():
    legs = drive((0, 0), (2, 0)), drive((2, 0), (2, 3), last=np.pi / 2)
    assert least_seconds(legs, BODY) == pytest.approx(2 + 4)


def test_a_robot_that_reverses_stops():
    # 5 m in 2 + 3 + 2 s, and 3 m back in 2 + 2 s.
    legs = drive((0, 0), (5, 0)), drive((5, 0), (2, 0), backwards=[True])
    assert least_seconds(legs, BODY) == pytest.approx(7 + 4)
    # Too short to get to its speed: 0.5 m at 0.5 m/s² to 0.5 m/s and back, 1 s each.
    assert least_seconds([drive((0, 0), (0.5, 0), (0, 0), backwards=[False, True])], BODY) == pytest.approx(
        2 + np.sqrt(2)
    )


def test_turns_take_their_time_where_there_is_not_enough_driving():
    around = drive((0, 0), (0, 0), first=0.0, last=3.0)
    assert least_seconds([around], BODY) == pytest.approx(1.5)
    assert least_seconds([around, drive((0, 0), (0.25, 0), first=3.0)], BODY) == pytest.approx(3)


def test_who_has_seen_enough_at_once_needs_no_time():
    assert least_seconds([], BODY) == 0


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=8), st.data())
def test_the_time_is_that_at_top_speed_at_least_and_more_where_the_robot_stops(places, data):
    backwards = data.draw(st.lists(st.booleans(), min_size=len(places) - 1, max_size=len(places) - 1))
    body = replace(BODY, top_turn_rate=np.inf)
    straight, reversing = (least_seconds([drive(*places, backwards=b)], body) for b in (None, backwards))
    length = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    assert length / BODY.top_speed <= straight + 1e-9
    assert straight <= reversing + 1e-9
