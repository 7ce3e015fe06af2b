"""Decks that a ramp leads up to, and tables."""

import numpy as np

from pipeline.traversability.traversability import assess_map
from pipeline.traversability.ways_up import height_above_ways
from tests.pipeline.worlds import RISE, flat, ground_points, ramp_and_deck, surface_of

HERE = np.array([[-0.5, 0.0, 0.0]])


def test_nothing_is_high_where_a_ramp_leads_up_to_it() -> None:
    world = assess_map(surface_of(ground_points(ramp_and_deck, (-1, 2), (-1, 1))))
    points = np.array([(-0.8, 0.5, 0.0), (1.2, 0.0, RISE), (1.2, 0.0, RISE + 0.5)])
    np.testing.assert_allclose(height_above_ways(world, HERE, points), [0, 0, 0.5], atol=0.01)


def test_a_table_is_as_high_as_it_stands() -> None:
    floor = ground_points(flat, (-1, 2), (-1, 1))
    under = (np.abs(floor[:, :2] - (1.2, 0.0)) < 0.3).all(axis=1)
    top = floor[under] + np.array([0, 0, 0.5], np.float32)
    for shown in (np.vstack([floor[~under], top]), np.vstack([floor, top])):
        heights = height_above_ways(assess_map(surface_of(shown)), HERE, top)
        np.testing.assert_allclose(heights, 0.5, atol=0.02)


def test_where_the_ground_is_unknown_that_next_to_it_counts() -> None:
    world = assess_map(surface_of(ground_points(flat, (-1, 1), (-1, 1))))
    assert height_above_ways(world, HERE, np.array([(7.0, 0.0, 0.8)])) == 0.8
    nowhere = np.array([[0.0, 0.0, 9.0]])
    assert height_above_ways(world, nowhere, np.array([(7.0, 0.0, 0.8)])) == 0.0
