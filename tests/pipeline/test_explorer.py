from dataclasses import replace

import numpy as np
import pytest

from pipeline.exploration.next_best_view import Exploration
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.explorer import PATIENCE, Explorer
from pipeline.frame import Frame
from pipeline.mapper import Keyframe
from pipeline.mission import Goals
from pipeline.navigation.navigator import Halt, Leg, Outcome
from pipeline.planning.path_plan import PathPlan
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot
from tests.pipeline.worlds import flat, ground_points, wall_points


class PlacedRobot(StillRobot):
    """A robot that is where it was put, whatever it is told."""

    def __init__(self):
        super().__init__()
        self.T = np.eye(4)

    def sense(self) -> Frame:
        return replace(super().sense(), T_odom_base=self.T)


@pytest.fixture
def explorer():
    return Explorer(PlacedRobot(), TruthClassifier())


class Beyond(Exploration):
    """Names the place at x = -1 where a path leads there."""

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        place = np.array([-1.0, 0.0])
        return Viewpoint(place, 0.0, False, 1.0) if np.isfinite(context.paths.cost_to(place)) else None


def keyframe_at(explorer: Explorer, x: float, yaw: float) -> Keyframe:
    """A keyframe of a robot at x on the map as it is."""
    traversability = explorer.mapper.traversability_layer.update(explorer.mapper.elevation_map)
    points, labels = np.zeros((0, 3), np.float32), np.zeros(0, np.uint8)
    frame = explorer.robot.sense()
    return Keyframe(frame, from_yaw(x, 0, 0, yaw), points, labels, [], [], traversability)


@pytest.mark.parametrize("freed", [True, False])
def test_what_holds_the_robot_is_an_obstacle_once_it_got_away(explorer, freed):
    explorer.navigator.follow = lambda way_points, *rest: (
        explorer.navigator.legs.append(Leg(way_points[-1, :2], Outcome.STUCK, 1.0))
        or explorer.navigator.halts.append(Halt(np.eye(4), Velocity(0.2), freed))
    )
    explorer.navigator.motion = explorer.robot.drive(Velocity())
    step = explorer.step()
    assert step.traversability.grid.at(step.traversability.traversable, [0.3, 0.0])
    ahead = PathPlan(np.array([(1.2, 0.0, 0.0)]), [], 1.2)
    viewpoint = Viewpoint(np.array([1.2, 0.0]), 0.0, turn=False, gain=1.0)
    assert not explorer.drive(replace(step, plan=ahead, viewpoint=viewpoint))
    traversability = explorer.step().traversability
    assert traversability.grid.at(traversability.hazard, [0.29, 0.0]) == freed
    assert traversability.lines_are_traversable([(-0.1, 0.0)], [(1.0, 0.0)])[0] != freed


@pytest.mark.parametrize("moved", [(5.0, 5.0), (0.0, 0.1)])
def test_ground_is_level_wherever_the_robot_is_set_down(explorer, moved):
    explorer.step()
    explorer.robot.T = from_yaw(*moved, 0, np.pi)
    step = explorer.step()
    assert step.traversability.grid.at(step.traversability.traversable, moved)
    assert step.was_kidnapped == (moved == (5.0, 5.0))


def test_a_robot_that_was_not_lifted_trusts_what_it_saw(explorer):
    explorer.step()
    known = explorer.mapper.elevation_map.elevation.copy()
    explorer.robot.T = from_yaw(-0.25, 0.0, 0, np.pi)
    explorer.robot.sense = lambda sense=explorer.robot.sense: replace(sense(), depth=np.zeros((120, 160), np.float32))
    explorer.step()
    assert np.isnan(explorer.mapper.elevation_map.elevation[np.isnan(known)]).all()


def test_a_robot_that_is_held_again_and_again_stays(explorer):
    explorer.navigator.follow = lambda way_points, *rest: explorer.navigator.legs.append(
        Leg(way_points[-1, :2], Outcome.STUCK, 1.0)
    )
    explorer.navigator.motion = explorer.robot.drive(Velocity())
    steps = [explorer.step()]
    while steps[-1].plan is not None and len(steps) < 20:
        explorer.drive(steps[-1])
        steps.append(explorer.step())
    assert len(steps) == 1 + PATIENCE
    assert steps[0].can_drive and not steps[-1].can_drive


def test_goals_come_before_views_and_views_only_as_long_as_goals_are_out_of_reach(explorer):
    explorer.step()
    explorer.mission.goals = Goals(explorer.mapper.topological_map, [(9.0, 9.0), (1.2, 0.0)])
    viewpoint = explorer.step().viewpoint
    np.testing.assert_allclose(viewpoint.position, (1.2, 0.0))
    explorer.robot.T = from_yaw(1.2, 0.0, 0, np.pi)
    explorer.lookout.T_odom_expected = explorer.robot.T
    assert explorer.step().viewpoint.gain > 0
    assert len(explorer.mission.goals.left) == 1
    explorer.mission.may_explore = False
    assert explorer.step().viewpoint is None
    explorer.mission.may_explore, explorer.mission.goals = True, Goals(explorer.mapper.topological_map, [])
    assert explorer.step().viewpoint is None


def test_a_robot_that_is_shut_in_goes_back_as_it_came(explorer):
    """A wall stands between the robot at x = 1 and the place at x = -1 from which it came."""
    ends = [wall_points((x, -1), (x, 1)) for x in (0.0, 2.0)]
    explorer.mapper.elevation_map.update(np.vstack([ground_points(flat, (-3, 2), (-1, 1)), *ends]))
    keyframe = keyframe_at(explorer, 1.0, np.pi)
    explorer.mission.exploration = Beyond(PIONEER)
    viewpoint, context, _ = explorer.decide(keyframe)
    assert viewpoint is None
    explorer.track = np.column_stack([np.linspace(-2, 1, 200), np.zeros(200)])
    viewpoint, beyond, back = explorer.decide(keyframe)
    assert viewpoint.position[0] < 0
    assert back[0, 0] > 0.5
    cell = tuple(keyframe.traversability.grid.cell_of(back[-1]))
    assert beyond.paths.reachable[cell]
    assert not context.paths.reachable[cell]


@pytest.mark.parametrize(("here", "there"), [(-1.0, 0.7), (0.7, -1.0)])
def test_when_nothing_is_left_the_map_is_that_of_the_larger_room(explorer, here, there):
    walls = [wall_points((x, -1), (x, 1)) for x in (-3.0, 0.0, 1.5)]
    explorer.mapper.elevation_map.update(np.vstack([ground_points(flat, (-3, 1.5), (-1, 1)), *walls]))
    explorer.track = np.column_stack([np.linspace(there, here, 100), np.zeros(100)])
    explorer.mission.may_explore = False
    keyframe = keyframe_at(explorer, here, 0.0)
    viewpoint, kept, _ = explorer.decide(keyframe)
    assert viewpoint is None
    assert kept.paths.reachable[tuple(keyframe.traversability.grid.cell_of([-1.0, 0.0]))]
