from dataclasses import replace

import numpy as np
import pytest

from pipeline.exploration import View
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.goals import Goals
from pipeline.navigation import Halt, Leg, Outcome
from pipeline.path_plan import PathPlan
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.still_robot import StillRobot


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


@pytest.mark.parametrize("freed", [True, False])
def test_what_holds_the_robot_is_an_obstacle_once_it_got_away(explorer, freed):
    explorer.navigator.follow = lambda way_points, *rest: (
        explorer.navigator.legs.append(Leg(way_points[-1, :2], Outcome.STUCK, 1.0))
        or explorer.navigator.halts.append(Halt(np.eye(4), Velocity(0.2), freed))
    )
    explorer.navigator.motion = explorer.robot.drive(Velocity())
    look = explorer.look()
    assert look.surface.grid.at(look.surface.drivable, [0.3, 0.0])
    ahead = PathPlan(np.array([(1.2, 0.0, 0.0)]), [], 1.2)
    view = View(np.array([1.2, 0.0]), 0.0, turn=False, gain=1.0)
    assert not explorer.drive(replace(look, plan=ahead, view=view))
    surface = explorer.look().surface
    assert surface.grid.at(surface.hazard, [0.29, 0.0]) == freed
    assert surface.lines_are_drivable([(-0.1, 0.0)], [(1.0, 0.0)])[0] != freed


@pytest.mark.parametrize("moved", [(5.0, 5.0), (0.0, 0.1)])
def test_ground_is_level_wherever_the_robot_is_set_down(explorer, moved):
    explorer.look()
    explorer.robot.T = from_yaw(*moved, 0, np.pi)
    look = explorer.look()
    assert look.surface.grid.at(look.surface.drivable, moved)
    assert look.was_lifted == (moved == (5.0, 5.0))


def test_a_robot_that_was_not_lifted_trusts_what_it_saw(explorer):
    explorer.look()
    known = explorer.surface_map.elevation.copy()
    explorer.robot.T = from_yaw(-0.25, 0.0, 0, np.pi)
    explorer.robot.sense = lambda sense=explorer.robot.sense: replace(
        sense(), depth=np.zeros((120, 160), np.float32)
    )
    explorer.look()
    assert np.isnan(explorer.surface_map.elevation[np.isnan(known)]).all()


def test_a_robot_that_is_held_again_and_again_stays(explorer):
    explorer.navigator.follow = lambda way_points, *rest: explorer.navigator.legs.append(
        Leg(way_points[-1, :2], Outcome.STUCK, 1.0)
    )
    explorer.navigator.motion = explorer.robot.drive(Velocity())
    looks = [explorer.look()]
    while looks[-1].plan is not None and len(looks) < 20:
        explorer.drive(looks[-1])
        looks.append(explorer.look())
    assert len(looks) == 1 + explorer.config.patience
    assert looks[0].can_drive and not looks[-1].can_drive


def test_goals_come_before_views_and_views_only_as_long_as_goals_are_out_of_reach(explorer):
    explorer.look()
    explorer.goals = Goals(explorer.topological_map, [(9.0, 9.0), (1.2, 0.0)])
    view = explorer.look().view
    np.testing.assert_allclose(view.position, (1.2, 0.0))
    explorer.robot.T = from_yaw(1.2, 0.0, 0, np.pi)
    explorer._T_map_last = explorer.robot.T
    assert explorer.look().view.gain > 0
    assert len(explorer.goals.left) == 1
    explorer.may_explore = False
    assert explorer.look().view is None
    explorer.may_explore, explorer.goals = True, Goals(explorer.topological_map, [])
    assert explorer.look().view is None
