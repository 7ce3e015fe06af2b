"""When a robot in a room with a wall turns back, and where it ends."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.deadline import Deadline, parking_place
from pipeline.exploration.viewpoint import Context
from pipeline.planning.pose_paths import PosePaths
from pipeline.plugins.league.brief import Task
from pipeline.transforms import from_yaw
from tests.pipeline.still_robot import StillRobot
from tests.pipeline.topological_map.grounds import U_TURN, room

BESIDE = 1.5  # m
START, FAR = np.array([-2.4, -1.5]), np.array([2.4, -1.5])  # either side of the wall


@dataclass(frozen=True, eq=False)
class Find:
    kind: str
    position: np.ndarray


@pytest.fixture(scope="module")
def world() -> Traversability:
    traversability, _ = room((-3, 3), (-2, 2), U_TURN)
    return traversability


def context_at(world: Traversability, here: np.ndarray, time: float) -> Context:
    T_map_base, frame = from_yaw(*here, 0, 0), replace(StillRobot().sense(), time=time)
    return Context(frame, T_map_base, world.elevation, PosePaths(world, here), T_map_base[None])


def started(world: Traversability, minutes: float, *tasks: Task, finds: tuple[Find, ...] = ()) -> Deadline:
    """A clock that starts at 100 s of the robot's time, with the robot at ``START``."""
    deadline = Deadline(
        100.0, 100.0 + 60 * minutes, lambda: finds, "home" in tasks, BESIDE if "park" in tasks else None
    )
    deadline.observe(context_at(world, START, 100.0))
    return deadline


def test_a_robot_that_need_not_return_uses_all_its_time(world: Traversability) -> None:
    deadline = started(world, 1, "explore")
    assert deadline.end == 160
    assert deadline.retreat is None
    assert deadline.allows(FAR, context_at(world, START, 159.0))
    assert not deadline.has_refused


def test_it_drives_on_only_if_the_way_back_fits_in_what_is_left(world: Traversability) -> None:
    deadline, begin = started(world, 2, "home"), context_at(world, START, 100.0)
    there = begin.paths.without_risk.cost_to(FAR)
    both = there + PosePaths(world, START, caution=0.0).cost_to(FAR)
    assert there < both < 120
    assert deadline.allows(FAR, context_at(world, START, deadline.end - both - 0.1))
    assert not deadline.has_refused
    assert not deadline.allows(FAR, context_at(world, START, deadline.end - both + 0.1))
    assert deadline.has_refused


@pytest.mark.parametrize("share", [1.0, 3.0])
def test_a_robot_that_was_slow_turns_back_earlier(world: Traversability, share: float) -> None:
    begin, back = context_at(world, START, 100.0), PosePaths(world, START, caution=0.0).cost_to(FAR)
    seconds = begin.paths.without_risk.cost_to(FAR)
    now = 100.0 + share * seconds
    enough = share * back + (share - 1) * seconds  # as slow as before, and as late again as the latest drive
    for spare, is_allowed in ((0.1, True), (-0.1, False)):
        deadline = started(world, (now - 100.0 + enough + spare) / 60, "home")
        deadline.set_out(FAR, begin)
        there = context_at(world, FAR, now)
        deadline.observe(there)
        assert deadline.allows(FAR, there) is is_allowed


def test_turning_on_the_spot_says_nothing_of_how_long_ways_take(world: Traversability) -> None:
    begin, back = context_at(world, START, 100.0), PosePaths(world, START, caution=0.0).cost_to(FAR)
    seconds = begin.paths.without_risk.cost_to(FAR)
    now = 110.0 + seconds
    for spare, is_allowed in ((0.1, True), (-0.1, False)):
        deadline = started(world, (now + back + 2.0 + spare - 100.0) / 60, "home")  # 2 s: as late as the latest turn
        here = begin
        for time in (102.0, 104.0, 106.0, 108.0, 110.0):
            deadline.set_out(START, here)
            here = context_at(world, START, time)
            deadline.observe(here)
        deadline.set_out(FAR, here)
        there = context_at(world, FAR, now)
        deadline.observe(there)
        assert deadline.allows(FAR, there) is is_allowed


def test_without_a_way_back_on_the_map_it_takes_as_long_as_the_way_so_far(world: Traversability) -> None:
    deadline = Deadline(0.0, 600.0, tuple, home=True)
    deadline.observe(context_at(world, np.array([9.0, 9.0]), 0.0))
    assert deadline.allows(START, context_at(world, START, 299.0))
    assert not deadline.allows(START, context_at(world, START, 301.0))


def test_it_parks_near_most_of_the_living_and_else_drives_home(world: Traversability) -> None:
    tasks: tuple[Task, ...] = ("explore", "home", "park")
    retreat = started(world, 10, *tasks).retreat
    assert retreat is not None
    assert (retreat.task, tuple(retreat.position)) == ("home", tuple(START))
    dead = Find("victim", np.array([0.9, 0.0, 0.3]))
    assert (retreat := started(world, 10, *tasks, finds=(dead,)).retreat) and retreat.task == "home"
    living = [np.array(place) for place in ((-2.9, 0.0, 0.3), (2.9, -1.9, 0.3), (2.0, 0.0, 0.3))]
    retreat = started(world, 10, *tasks, finds=tuple(Find("heat", place) for place in living)).retreat
    assert retreat is not None
    assert retreat.task == "park"
    near = [np.linalg.norm(place[:2] - retreat.position) <= BESIDE - 0.15 for place in living]
    assert near == [False, True, True]


def test_nobody_is_within_reach(world: Traversability) -> None:
    paths = PosePaths(world, START)
    assert parking_place(np.zeros((0, 2)), paths, BESIDE - 0.15) is None
    assert parking_place(np.array([[9.0, 9.0]]), paths, BESIDE - 0.15) is None
    assert parking_place(np.array([[0.0, 0.0]]), PosePaths(world, (9.0, 9.0)), BESIDE - 0.15) is None
