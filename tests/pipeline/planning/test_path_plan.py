"""Plans over the topological map."""

import numpy as np
import pytest

from pipeline.planning.path_plan import order_goals, plan_path, unreachable_reason
from pipeline.planning.pose_paths import PosePaths
from tests.pipeline.topological_map.grounds import U_TURN, room, topology_of

BOX = [((1.0, 1.0), (2.6, 1.0)), ((2.6, 1.0), (2.6, 2.6)), ((2.6, 2.6), (1.0, 2.6)), ((1.0, 2.6), (1.0, 1.0))]
"""Walls around ground that cannot be reached."""


@pytest.fixture(scope="module")
def u_turn():
    traversability, segments = room((-3, 3), (-2, 2), U_TURN)
    return traversability, topology_of(traversability, segments, (-2, -1.5))


def test_a_goal_in_sight_is_driven_to_straight(u_turn):
    traversability, topology = u_turn
    plan = plan_path(topology, PosePaths(traversability, (-2, -1.5)), (-1, 0.5))
    assert plan is not None
    assert plan.nodes == []
    np.testing.assert_allclose(plan.waypoints, [[-1, 0.5, 0]], atol=1e-6)


@pytest.mark.parametrize("goal", [(1.0, -1.5), (2.5, 0.0), (0.6, 0.5)])
def test_a_goal_behind_a_wall_is_reached_over_nodes(u_turn, goal):
    traversability, topology = u_turn
    paths = PosePaths(traversability, (-1.0, -1.5))
    plan = plan_path(topology, paths, goal)
    assert plan is not None
    assert plan.nodes
    way = np.vstack([[paths.start], plan.waypoints[:, :2]])
    assert np.isfinite(traversability.line_seconds(way[:-1], way[1:])).all()
    assert plan.length == pytest.approx(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert plan.length <= 1.25 * np.linalg.norm(np.diff(paths.path_to(goal), axis=0), axis=1).sum()
    assert len(plan.backwards) == len(plan.waypoints)


def test_on_the_tree_the_way_leads_over_its_nodes():
    traversability, segments = room((-3, 3), (-2, 2), U_TURN)
    topology = topology_of(traversability, segments, (-2, -1.5), "mst")
    plan = plan_path(topology, PosePaths(traversability, (-1.0, -1.5)), (2.5, 0.0), np.pi / 2)
    assert plan is not None
    assert plan.nodes
    for node in plan.nodes:
        assert np.linalg.norm(plan.waypoints - topology.nodes[node].position, axis=1).min() < 0.01


def test_the_quicker_side_of_an_island_is_taken():
    island = [((-1, -0.6), (1, -0.6)), ((1, -0.6), (1, 0.6)), ((1, 0.6), (-1, 0.6)), ((-1, 0.6), (-1, -0.6))]
    traversability, segments = room((-2.5, 2.5), (-2, 2), island)
    topology = topology_of(traversability, segments, (-1.8, 0))
    for side in (-1, 1):
        plan = plan_path(topology, PosePaths(traversability, (-1.8, 0.3 * side)), (1.8, 0.4 * side))
        assert plan is not None
        assert (side * plan.waypoints[:-1, 1] > 0.6).all()


def test_where_the_map_contradicts_a_way_there_is_none(u_turn):
    traversability, topology = u_turn
    assert plan_path(topology, PosePaths(traversability, (-1.0, -1.5)), (1.0, -1.5)) is not None
    closed, segments = room((-3, 3), (-2, 2), [((0, -2), (0, 2))])
    paths = PosePaths(closed, (-1.0, -1.5))
    topology.update([], segments, paths)
    assert plan_path(topology, paths, (1.0, -1.5)) is None


def test_what_stands_between_the_robot_and_a_goal_is_said():
    traversability, segments = room((-3, 3), (-3, 3), BOX)
    topology = topology_of(traversability, segments, (-2, -2))
    paths = PosePaths(traversability, (-2, -2))
    reasons = {
        (1.0, 1.8): "in a wall",
        (0.85, 1.8): "too close",
        (50.0, 0.0): "outside the mapped area",
        (1.8, 1.8): "cannot be reached from (-2.00, -2.00) m: there is no drivable path",
        (np.nan, 0.0): "(nan, 0.00)",
    }
    for goal, reason in reasons.items():
        message = unreachable_reason(paths, goal)
        assert message is not None
        assert reason in message
        assert "\n" not in message
        assert plan_path(topology, paths, goal) is None
    assert unreachable_reason(paths, (0.0, 0.0)) is None
    lost = PosePaths(traversability, (30.0, 30.0))
    assert "the robot cannot leave its current position" in str(unreachable_reason(lost, (0.0, 0.0)))
    assert plan_path(topology, lost, (0.0, 0.0)) is None


def test_goals_come_in_a_short_order_and_those_out_of_reach_not_at_all(u_turn):
    traversability, _ = u_turn
    paths = PosePaths(traversability, (-2.4, -1.5))
    goals = [(1.5, -1.5), (-1.0, 0.0), (1.0, 1.0), (9.0, 9.0), (-1.0, -1.4)]
    assert order_goals(paths, goals) == [4, 1, 2, 0]
    assert order_goals(paths, [(9.0, 9.0)]) == []
    assert order_goals(PosePaths(traversability, (30.0, 30.0)), goals) == []


def test_a_robot_that_stands_too_near_to_a_wall_may_still_stay():
    traversability, segments = room((-3, 3), (-2, 2), [((1.0, -2), (1.0, 2))])
    topology, here = topology_of(traversability, segments, (-1, 0)), (0.78, 0.0)
    assert not traversability.grid.at(traversability.traversable, np.array(here))
    plan = plan_path(topology, PosePaths(traversability, here, 0.0), here, 0.0)
    assert plan is not None
    assert plan.length == 0
