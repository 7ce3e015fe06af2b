"""Stretches: lines that arcs join."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.planning.stretches import ArcConfig, Stretch, stretches_of
from pipeline.transforms import from_yaw, wrap_angle

HERE = np.zeros(3)
SPACING = ArcConfig().spacing


def everywhere(poses):
    return True


def nowhere(poses):
    return False


def way(*places, start=HERE, heading=None, backwards=None, fits=everywhere):
    backwards = [False] * len(places) if backwards is None else backwards
    return stretches_of(np.array(places, float), np.array(backwards), np.asarray(start, float), heading, fits)


def kinks(stretch):
    """(N,) rad, by which the direction of travel differs from that to the next place."""
    steps = np.diff(stretch.poses[:, :2], axis=0)
    return wrap_angle(np.arctan2(steps[:, 1], steps[:, 0]) - (stretch.poses[:-1, 2] + stretch.poses[1:, 2]) / 2)


def test_without_room_for_arcs_it_turns_in_place_at_each_bend():
    first, second = way((1, 0), (1, 1), fits=nowhere)
    np.testing.assert_allclose(first.poses[-1], (1, 0, 0))
    np.testing.assert_allclose(second.poses[[0, -1]], [(1, 0, np.pi / 2), (1, 1, np.pi / 2)])
    assert first.length == pytest.approx(1)


def test_an_arc_cuts_a_corner():
    (whole,) = way((1, 0), (1, 1))
    radius = 1 / np.abs(whole.curvature).max()
    assert radius == pytest.approx(max(ArcConfig().radii), rel=0.01)
    assert whole.length == pytest.approx(2 - (2 - np.pi / 2) * radius, rel=0.01)
    assert np.abs(kinks(whole)).max() < np.deg2rad(2)


def test_the_widest_arc_that_fits_is_taken():
    def fits(poses):
        return bool((np.hypot(poses[:, 0] - 1, poses[:, 1]) < 0.4).all())

    (whole,) = way((1, 0), (1, 1), fits=fits)
    assert 1 / np.abs(whole.curvature).max() == pytest.approx(0.3, rel=0.01)


def test_an_arc_leads_out_of_the_present_heading_and_another_into_the_wanted_one():
    (whole,) = way((3, 0), start=(0, 0, np.deg2rad(60)), heading=np.deg2rad(-80))
    np.testing.assert_allclose(whole.poses[0], (0, 0, np.deg2rad(60)), atol=1e-9)
    np.testing.assert_allclose(whole.poses[-1, :2], (3, 0), atol=1e-9)
    assert wrap_angle(whole.last_heading - np.deg2rad(-80)) == pytest.approx(0)


def test_it_turns_around_in_place():
    (back,) = way((-1, 0))
    np.testing.assert_allclose(back.poses[0, :2], (0, 0))
    assert abs(wrap_angle(back.heading - np.pi)) < 1e-9


def test_it_stands_where_it_changes_its_direction():
    ahead, back = way((1, 0), (0, 0.1), backwards=[False, True])
    assert (ahead.backwards, back.backwards) == (False, True)
    assert abs(wrap_angle(back.heading)) < np.deg2rad(15)
    np.testing.assert_allclose(back.poses[-1, :2], (0, 0.1), atol=1e-9)


@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=4),
    st.floats(-np.pi, np.pi),
    st.one_of(st.none(), st.floats(-np.pi, np.pi)),
)
def test_a_way_leads_on_from_the_robot_to_its_end(places, yaw, heading):
    stretches = way(*places, start=(0, 0, yaw), heading=heading)
    if not stretches:
        assert np.linalg.norm(places[-1]) < len(places) * SPACING + 1e-6
        return
    ends = [np.zeros(2), *(s.poses[-1, :2] for s in stretches)]
    for before, after in zip(ends, stretches, strict=False):
        assert np.linalg.norm(after.poses[0, :2] - before) <= SPACING / 2 + 1e-6
    assert np.linalg.norm(ends[-1] - places[-1]) <= len(places) * SPACING + 1e-6
    for stretch in stretches:
        steps = np.linalg.norm(np.diff(stretch.poses[:, :2], axis=0), axis=1)
        assert (steps > 0).all()
        assert steps.max() <= 1.5 * SPACING + 1e-6
        sharpest = SPACING / min(ArcConfig().radii)  # the robot brakes where its direction changes faster
        assert np.abs(wrap_angle(np.diff(stretch.poses[:, 2]))).max() < 1.2 * sharpest


def test_offsets_are_what_is_left_and_how_far_aside():
    (line,) = way((2, 0))
    at = line.nearest(np.array([0.3, 0.1]), 0)
    assert line.offsets(np.array([0.3, 0.1]), at) == pytest.approx((1.7, 0.1))
    left = line.after(at)
    assert left.length == pytest.approx(1.7, abs=SPACING)
    turned = left.moved(from_yaw(1.0, 0.0, 0.0, np.pi / 2))
    np.testing.assert_allclose(turned.poses[-1], (1, 2, np.pi / 2), atol=1e-6)


def test_one_stretch_goes_on_with_another():
    (first,), (second,), (third,) = way((1, 0)), way((2, 0), start=(1, 0, 0)), way((1, 1), start=(1, 0, np.pi / 2))
    assert first.leads_to(second, 0.1)
    assert not first.leads_to(third, 0.1)
    both = first.joined_with(second)
    assert both.length == pytest.approx(2)
    assert all(a < b for a, b in pairwise(both.distances_along))
    assert isinstance(both, Stretch)
