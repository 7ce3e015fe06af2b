"""Goals in ground that nobody has seen yet."""

import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.mission import Goals
from pipeline.planning.pose_paths import PosePaths, nearest_heading
from pipeline.transforms import from_yaw
from tests.pipeline.exploration.asking import closed_room, context, corridor, next_viewpoint
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points

EAST = from_yaw(0, 0, 0, 0)


def walls_around(x: float, y: float, half: float = 1.0):
    """Points of four walls around a place."""
    a, b, c, d = (x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)
    return np.vstack([wall_points(*side) for side in ((a, b), (b, c), (c, d), (d, a))])


def test_a_goal_beyond_the_map_is_approached_by_looking_along_the_way_to_it():
    view = next_viewpoint(Goals([(6.0, 0.0)]), corridor(-2, 2), from_yaw(0, 0, 0, np.pi / 2))
    assert view is not None and view.turn
    assert view.position[0] > -0.5 and abs(view.heading) < np.deg2rad(30)


def test_a_goal_on_seen_ground_is_driven_to_without_another_look():
    view = next_viewpoint(Goals([(1.2, 0.0)]), corridor(-2, 2), EAST)
    assert view is not None and not view.turn
    np.testing.assert_allclose(view.position, (1.2, 0.0))


@pytest.mark.parametrize("goal", [(6.0, 0.0), (2.0, 0.0), (500.0, 0.0), (1e9, 0.0), (np.nan, 0.0)])
def test_no_way_leads_out_of_a_closed_room_nor_into_its_wall(goal):
    goals, here = Goals([goal]), context(closed_room(), EAST)
    goals.ignores_margin = True
    goals.observe(here)
    assert goals.next_viewpoint(here) is None and not goals.may_open
    goals.refuse()
    assert goals.visits[0].failure_reason


def test_a_goal_that_walls_enclose_is_not_approached():
    world = corridor(-2, 2)
    world.update(np.vstack([walls_around(6.0, 0.0), ground_points(flat, (4.7, 7.3), (-1.3, 1.3))]))
    assert next_viewpoint(Goals([(6.0, 0.0)]), world, EAST) is None
    assert next_viewpoint(Goals([(9.0, 0.0)]), world, EAST) is not None


def test_a_view_has_shown_its_ground_as_soon_as_the_map_has_it():
    goals, world = Goals([(6.0, 0.0)]), corridor(-2, 2)
    assert not goals.is_shown(world)
    next_viewpoint(goals, world, EAST)
    assert not goals.is_shown(world)
    world.update(ground_points(flat, (2, 5), (-1, 1)))
    assert goals.is_shown(world)


@pytest.mark.parametrize("short", [0.0, 0.5])
def test_ground_that_no_view_shows_is_given_up(short):
    goals = Goals([(6.0, 0.0)])
    world, here, views = corridor(-2, 2, is_closed=True), EAST, 0
    while (view := next_viewpoint(goals, world, here)) is not None:
        # Stopped so far before its view, m.
        views, here = views + 1, from_yaw(*view.position, 0, view.heading) @ from_yaw(-short, 0, 0, 0)
        assert views < 40
    assert views >= 3  # what one keyframe missed another may show
    goals.ignores_margin = True
    assert goals.may_open  # since no hazard is in the way
    goals.refuse()
    assert goals.visits[0].failure_reason


def test_home_that_only_its_surroundings_can_replace_is_given_up_after_the_map_has_grown():
    floor = ground_points(flat, (-2, 2), (-1, 1)), wall_points((-2, -1), (-2, 1))
    home, pose = Goals([(-1.8, 0.0)], may_be_near=True), from_yaw(1.3, 0, 0, np.pi)
    assert next_viewpoint(home, surface_of(*floor, wall_points((0, -1), (0, 1))), pose) is None
    view = next_viewpoint(home, surface_of(*floor, ground_points(flat, (2, 6), (-1, 1))), pose)
    assert view is not None
    home.refuse()
    assert home.visits[0].failure_reason


def test_the_time_of_a_view_does_not_contain_the_risk_on_the_path():
    here = context(corridor(-3, 2, half_width=0.34), from_yaw(-2, 0, 0, 0))
    goals = Goals([(6.0, 0.0)])
    goals.observe(here)
    view = goals.next_viewpoint(here)
    cell, heading = here.traversability.grid.cell_of(view.position), nearest_heading(view.heading)
    quick, slow = (paths.seconds_to(cell[None])[0, heading] for paths in (here.paths.without_risk, here.paths))
    assert view.seconds == pytest.approx(ExplorationConfig().keyframe_time + quick)
    assert slow > 2 * quick


def test_of_two_unseen_goals_the_nearer_comes_first():
    for goals in ([(9.0, 0.0), (-4.0, 0.0)], [(-4.0, 0.0), (9.0, 0.0)]):
        view = next_viewpoint(Goals(goals), corridor(-2, 2), from_yaw(0, 0, 0, np.pi / 2))
        assert view is not None and abs(view.heading) > np.pi / 2


def test_unseen_ground_is_free_but_for_hazards_and_what_is_shut():
    ground, goal = assess_map(corridor(-2, 2)), np.array([(6.0, 0.0)])
    free = ground.with_unseen_free(goal, 3.0, np.zeros((0, 2)))
    assert free.grid.holds(free.grid.cell_of([(9.0, 3.0), (3.0, -3.0), (-2.0, 0.0)])).all()
    np.testing.assert_array_equal(free.hazard[free.grid.box_of(ground.grid)], ground.hazard)
    known = PosePaths(ground, (0.0, 0.0), 0.0)
    assert np.isinf(known.cost_to(goal[0])) and np.isfinite(PosePaths(free, (0.0, 0.0), 0.0).cost_to(goal[0]))
    across = np.column_stack([np.full(200, 3.0), np.linspace(-5, 5, 200)])
    shut = ground.with_unseen_free(goal, 3.0, across)
    assert not shut.grid.at(shut.traversable, (3.0, 0.0)) and free.grid.at(free.traversable, (3.0, 0.0))


def test_what_the_robot_drives_over_costs_no_more_where_unseen_ground_is_free():
    ground = assess_map(corridor(-2, 2))
    free = ground.with_unseen_free(np.array([(4.0, 0.0)]), 1.0, np.zeros((0, 2)))
    places = np.array([(1.0, 0.0), (-1.0, 0.3)])
    for place in places:
        assert PosePaths(free, (0.0, 0.0), 0.0).cost_to(place) <= PosePaths(ground, (0.0, 0.0), 0.0).cost_to(place)
