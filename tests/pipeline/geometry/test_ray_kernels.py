"""Ray traversal, compared with fine sampling along the rays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.geometry.ray_kernels import mark_line
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import FREE, OCCUPIED, UNKNOWN, MetricMap

coordinates = st.tuples(*[st.floats(0.01, 8.99)] * 3)


def walked(start, stop):
    marks = np.zeros((9, 9, 9), np.uint8)
    mark_line(*start, *stop, marks)
    return marks == 1


@given(coordinates, coordinates)
def test_a_walk_goes_through_all_that_fine_sampling_finds_from_face_to_face(start, stop):
    found = walked(start, stop)
    samples = np.array(start) + np.linspace(0, 1, 3001)[:, None] * (np.array(stop) - np.array(start))
    sampled = np.zeros_like(found)
    sampled[tuple(samples.astype(int).T)] = True
    assert not (sampled & ~found).any()
    assert found.sum() == 1 + np.abs(np.array(stop).astype(int) - np.array(start).astype(int)).sum()


@given(coordinates)
def test_a_walk_to_where_it_begins_is_one_voxel(start):
    assert walked(start, start).sum() == 1


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("step", [-1, 1])
def test_a_walk_along_an_axis_on_a_face_stays_straight(axis, step):
    start, stop = np.full(3, 4.0), np.full(3, 4.0)
    stop[axis] += 3.5 * step
    places = np.argwhere(walked(start, stop))
    assert len(places) == (4 if step > 0 else 5)
    assert (np.delete(places, axis, axis=1) == 4).all()


def test_a_voxel_with_an_end_point_is_occupied_though_other_rays_cross_it():
    grid = MetricMap(MetricMapConfig(margin=0))
    grid.integrate_points([(1.0, 0, 0), *[(2.0, 0, 0)] * 50], (0, 0, 0))
    assert grid.p_free_at([(1, 0, 0), (2, 0, 0), (1.5, 0, 0)]).tolist() == [OCCUPIED, OCCUPIED, FREE]


def test_a_scan_counts_once_however_many_rays_it_has():
    once, often = MetricMap(), MetricMap()
    once.integrate_points([(1.0, 0, 0)], (0, 0, 0))
    often.integrate_points([(1.0, 0, 0)] * 100, (0, 0, 0))
    lower, upper = once.bounds()
    np.testing.assert_array_equal(once.log_odds(lower, upper), often.log_odds(lower, upper))


def test_a_point_beyond_the_range_frees_up_to_the_range():
    grid = MetricMap(MetricMapConfig(max_range=2, margin=0))
    grid.integrate_points([(5.0, 0, 0)], (0, 0, 0))
    assert grid.p_free_at([(1.95, 0, 0), (2.2, 0, 0), (5, 0, 0)]).tolist() == [FREE, UNKNOWN, UNKNOWN]


@settings(deadline=None)
@given(st.floats(0.5, 3), st.floats(0, 0.4))
def test_the_margin_keeps_the_way_before_the_end_unknown(length, margin):
    grid = MetricMap(MetricMapConfig(margin=margin, max_range=5))
    grid.integrate_points([(length, 0, 0)], (0, 0, 0))
    last_free = grid.free_centres()[:, 0].max()
    assert last_free - 0.05 <= length - margin < last_free + 0.15
