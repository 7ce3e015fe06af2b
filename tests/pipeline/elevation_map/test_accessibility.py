"""Decks with a ramp up to them, and tables."""

import numpy as np

from pipeline.elevation_map.accessibility import height_above_accessible, is_inaccessible
from pipeline.elevation_map.traversability import assess_map
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RISE, flat, ground_points, ramp_and_deck, surface_of

HERE = np.array([[-0.5, 0.0, 0.0]])


def test_nothing_is_high_where_a_ramp_leads_up_to_it() -> None:
    world = assess_map(surface_of(ground_points(ramp_and_deck, (-1, 2), (-1, 1))))
    points = np.array([(-0.8, 0.5, 0.0), (1.2, 0.0, RISE), (1.2, 0.0, RISE + 0.5)])
    np.testing.assert_allclose(height_above_accessible(world, HERE, points), [0, 0, 0.5], atol=0.01)


def test_a_table_is_as_high_as_it_stands() -> None:
    floor = ground_points(flat, (-1, 2), (-1, 1))
    under = (np.abs(floor[:, :2] - (1.2, 0.0)) < 0.3).all(axis=1)
    top = floor[under] + np.array([0, 0, 0.5], np.float32)
    for shown in (np.vstack([floor[~under], top]), np.vstack([floor, top])):
        heights = height_above_accessible(assess_map(surface_of(shown)), HERE, top)
        np.testing.assert_allclose(heights, 0.5, atol=0.02)


def test_where_the_ground_is_unknown_that_next_to_it_counts() -> None:
    world = assess_map(surface_of(ground_points(flat, (-1, 1), (-1, 1))))
    assert height_above_accessible(world, HERE, np.array([(7.0, 0.0, 0.8)])) == 0.8
    nowhere = np.array([[0.0, 0.0, 9.0]])
    assert height_above_accessible(world, nowhere, np.array([(7.0, 0.0, 0.8)])) == 0.0


def test_a_surface_without_room_for_half_a_robot_is_no_way() -> None:
    floor = ground_points(flat, (-1, 3), (-2, 2))
    side = np.abs(floor[:, :2] - (1.0, 0.0)).max(axis=1)
    foot = side < PIONEER.width / 5
    narrow, broad = foot & (floor[:, 0] < 2), side < PIONEER.width / 2
    ledge = (np.abs(floor[:, 1]) < 0.05) & (floor[:, 0] > 1) & (floor[:, 0] < 2)
    for surface, is_none in ((narrow, True), (broad, False), (ledge, True)):
        points = floor[surface] + np.array([0, 0, 0.05], np.float32)
        world = assess_map(surface_of(np.vstack([floor[~surface], points])))
        assert (is_inaccessible(world, HERE, points) == is_none).all()
    points = floor[broad | ledge]
    far = points[:, 0] - 1 > 1.3 * PIONEER.width  # from its middle
    assert (is_inaccessible(assess_map(surface_of(floor)), HERE, points)[far]).all() and far.any()


def test_a_table_is_no_way_however_broad() -> None:
    floor = ground_points(flat, (-1, 2), (-1, 1))
    top = floor[(np.abs(floor[:, :2] - (1.2, 0.0)) < 0.4).all(axis=1)] + np.array(
        [0, 0, PIONEER.headroom + 0.05], np.float32
    )
    world = assess_map(surface_of(np.vstack([floor, top])))
    assert is_inaccessible(world, HERE, top).all()
    from_below = top[:, 0] > 1.2
    np.testing.assert_array_equal(is_inaccessible(world, HERE, top, from_below), ~from_below)


def test_a_ramp_that_is_too_steep_for_the_robot_leads_up_all_the_same() -> None:
    def steep(x, y):
        return np.where(np.abs(y) < 0.6, np.clip(x - 1, 0, 1.1), 0.0)

    world = ground_points(steep, (-1, 3), (-1, 1))
    ramp = world[(np.abs(world[:, 1]) < 0.55) & (world[:, 0] > 1)]
    assert ramp[:, 2].max() > PIONEER.headroom
    ground = assess_map(surface_of(world))
    assert ground.hazard[tuple(ground.grid.cell_of(ramp[ramp[:, 0] < 2]).T)].all()
    assert not is_inaccessible(ground, HERE, ramp).any()
    assert is_inaccessible(ground, HERE, ramp[ramp[:, 2] > 0.3])[-1]
