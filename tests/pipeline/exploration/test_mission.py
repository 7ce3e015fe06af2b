"""Driving to goals on known ground, by a robot that gets wherever it is sent unless it is held."""

from dataclasses import replace
from itertools import count, pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.exploration import mission
from pipeline.exploration.config import ExplorationConfig, UnseenWaysConfig
from pipeline.exploration.deadline import Deadline
from pipeline.exploration.mission import Goals, Mission
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot
from tests.pipeline.topological_map.grounds import U_TURN, room

START = (-2.4, -1.5)
PATIENCE = 6
PATIENT = ExplorationConfig(max_drives_without_progress=PATIENCE)


@pytest.fixture(scope="module")
def world():
    corners: list[tuple[float, float]] = [(-3, -2), (3, -2), (3, 2), (-3, 2), (-3, -2)]
    traversability, _ = room((-3, 3), (-2, 2), [*U_TURN, *pairwise(corners)])
    return traversability


def context_at(world, here):
    """What the robot knows at a place (2,)."""
    T_map_base, paths = from_yaw(*here, 0, 0), PosePaths(world, here)
    return Context(StillRobot().sense(), T_map_base, world.elevation, paths, T_map_base[None])


def drive(world, goals, share=1.0, here=START, most=100):
    """Drive to each viewpoint by a ``share`` of the way; returns the places that the robot was sent to."""
    sent, here = [], np.array(here)
    while len(sent) < most:
        context = context_at(world, here)
        goals.observe(context)
        if (viewpoint := goals.next_viewpoint(context)) is None:
            break
        goals.commit(viewpoint, context)
        sent.append(tuple(viewpoint.position.round(3)))
        here = here + share * (viewpoint.position - here)
    assert len(sent) < most
    goals.refuse()
    return sent


def test_goals_are_visited_in_a_short_order(world):
    goals = Goals([(1.5, -1.5), (-1.0, 0.0), (1.0, 1.0), (-1.0, -1.4)])
    assert drive(world, goals) == [(-1.0, -1.4), (-1.0, 0.0), (1.0, 1.0), (1.5, -1.5)]
    assert not goals.remaining
    assert all(visit.failure_reason is None for visit in goals.visits)


def test_what_cannot_be_reached_is_refused_with_a_reason_and_the_rest_visited(world):
    goals = Goals([(9.0, 9.0), (-1.0, -1.4), (0.02, -1.0), (np.nan, 0.0)])
    assert drive(world, goals) == [(-1.0, -1.4)]
    outcomes = {tuple(visit.goal): visit.failure_reason for visit in goals.visits}
    assert outcomes[-1.0, -1.4] is None
    assert "(9.00, 9.00) m" in str(outcomes[9.0, 9.0])
    assert "in a wall" in outcomes[0.02, -1.0]
    assert sum("(nan, 0.00)" in str(obstacle) for obstacle in outcomes.values()) == 1


def test_a_robot_that_is_held_gives_a_goal_up(world):
    goals = Goals([(-1.0, -1.4)], config=PATIENT)
    assert len(drive(world, goals, share=0.0)) == PATIENCE
    assert "given up" in str(goals.visits[0].failure_reason)


def test_a_robot_that_comes_nearer_is_patient(world):
    goals = Goals([(-1.0, -1.4)], config=PATIENT)
    assert len(drive(world, goals, share=0.15)) > PATIENCE
    assert goals.visits[0].failure_reason is None


def test_goals_that_take_turns_are_given_up_too(world, monkeypatch):
    turns = count()
    monkeypatch.setattr(mission, "order_goals", lambda *given: [next(turns) % len(given[1])] if given[1] else [])
    goals = Goals([(-1.0, -1.4), (1.5, -1.5)], config=PATIENT)
    assert len(drive(world, goals, share=0.0)) <= 2 * PATIENCE
    assert all("given up" in str(visit.failure_reason) for visit in goals.visits)


def test_home_may_be_beside_where_the_robot_can_drive(world):
    corner = (-2.9, -1.9)
    refused, snapped = Goals([corner]), Goals([corner], may_be_near=True)
    assert drive(world, refused) == []
    assert "too close" in str(refused.visits[0].failure_reason)
    (place,) = drive(world, snapped)
    assert np.linalg.norm(np.array(place) - corner) <= 0.5
    assert snapped.visits[0].failure_reason is None


def test_a_goal_where_the_robot_stands_is_reached_without_a_drive(world):
    goals = Goals([(START[0] + 0.07, START[1])])
    assert drive(world, goals) == []
    assert goals.visits[0].failure_reason is None


def test_what_cannot_be_reached_yet_is_not_refused_before_all_is_over(world):
    goals = Goals([(9.0, 9.0)])
    context = context_at(world, START)
    goals.observe(context)
    assert goals.next_viewpoint(context) is None
    assert len(goals.remaining) == 1
    goals.refuse()
    assert "(9.00, 9.00) m" in str(goals.visits[0].failure_reason)


def test_each_goal_has_its_own_way_and_time(world):
    goals = Goals([(-1.0, -1.4), (1.5, -1.5)])
    for second, (place, driven) in enumerate([(START, 1.0), ((-1.0, -1.4), 3.0), ((1.5, -1.5), 10.0)]):
        here = replace(context_at(world, place), driven=driven)
        goals.observe(replace(here, frame=replace(here.frame, time=10.0 * second)))
    assert [visit.distance for visit in goals.visits] == [2.0, 7.0]
    assert [(visit.begin, visit.end) for visit in goals.visits] == [(0.0, 10.0), (10.0, 20.0)]


def test_a_mission_turns_back_on_the_way_to_goals_in_time(world):
    mission = Mission(Goals([]))
    mission.deadline = Deadline(0.0, 1.0, list, home=True)
    mission.goals, here = Goals([(1.5, -1.5)]), context_at(world, START)
    mission.observe(here)
    assert mission.choose(here) is None and mission.is_out_of_time


def test_time_that_ended_one_task_ends_no_other(world):
    mission, robot = Mission(Shown()), SimpleNamespace(T_map_start=np.eye(4), is_held=False)
    mission.deadline, here = Deadline(0.0, 1.0, list, home=True), context_at(world, START)
    here = replace(here, frame=replace(here.frame, time=2.0))
    tasks = []
    for task in mission.tasks([(0.02, -1.0)], True, robot):
        tasks.append(task)
        mission.observe(here)
        mission.choose(here)
        assert mission.is_out_of_time == (task == "exploring")
    assert tasks == ["exploring", "goals", "home"]
    (visit,) = mission.visits["goals"]
    assert "in a wall" in visit.failure_reason


def test_a_drive_that_no_strategy_chose_is_not_late(world):
    mission, here = Mission(Shown()), context_at(world, START)
    mission.deadline = Deadline(0.0, 60.0, list, home=True)
    mission.observe(here)
    mission.set_out_without_strategy()
    later = replace(here, frame=replace(here.frame, time=45.0))
    mission.observe(later)
    assert mission.choose(later) is not None and not mission.is_out_of_time


def test_a_goal_on_seen_ground_may_be_far_if_another_is_out_of_reach(world):
    far = (2.0, -1.5)
    near = ExplorationConfig(unseen_ways=UnseenWaysConfig(farthest=2.0))
    goals = Goals([far, (9.0, 9.0)], config=near)
    assert drive(world, goals) == [far]
    reached, refused = goals.visits
    assert tuple(reached.goal) == far and reached.failure_reason is None
    assert "(9.00, 9.00) m" in refused.failure_reason


def test_a_goal_is_refused_when_the_episode_ends_before_any_step():
    goals = Goals([(1.0, 2.0)])
    goals.refuse()
    assert "(1.00, 2.00) m" in goals.visits[0].failure_reason


class Shown:
    """A strategy of one's own that sends the robot to one place, and takes it as shown at once."""

    def observe(self, context):
        pass

    def next_viewpoint(self, context):
        return Viewpoint(np.array(START), 0.0, turn=False, gain=0.0)

    def commit(self, viewpoint, context):
        pass

    def is_shown(self, elevation_map):
        return True


def test_only_a_drive_that_a_strategy_chose_may_end_because_what_it_should_show_is_shown(world):
    plan = Mission(Shown())
    for _ in range(2):
        assert plan.choose(context_at(world, START)) is not None
        assert plan.is_shown(ElevationMap(PIONEER))
        plan.set_out_without_strategy()
        assert not plan.is_shown(ElevationMap(PIONEER))
