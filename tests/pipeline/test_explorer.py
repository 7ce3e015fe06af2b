from dataclasses import replace

import numpy as np
import pytest

from pipeline.exploration.next_best_view import View
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.goals import Goals
from pipeline.navigation.navigator import Halt, Leg, Outcome
from pipeline.planning.path_plan import PathPlan
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import drivable_surface
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


def test_a_robot_that_is_shut_in_goes_back_as_it_came(explorer):
    """A wall stands between the robot at x = 1 and the place at x = -1 from which it came."""
    ends = [wall_points((x, -1), (x, 1)) for x in (0.0, 2.0)]
    explorer.surface_map.update(np.vstack([ground_points(flat, (-3, 2), (-1, 1)), *ends]))
    surface, T = drivable_surface(explorer.surface_map), from_yaw(1.0, 0, 0, np.pi)
    paths = ShortestPaths(surface, (1.0, 0.0))
    assert explorer._view_beyond(surface, paths, T) == (None, paths, None)
    explorer._track = np.column_stack([np.linspace(-2, 1, 200), np.zeros(200)])
    view, beyond, back = explorer._view_beyond(surface, paths, T)
    assert view.position[0] < 0
    assert back[0, 0] > 0.5
    assert beyond.reachable[tuple(surface.grid.cell_of(back[-1]))]
    assert not paths.reachable[tuple(surface.grid.cell_of(back[-1]))]


@pytest.mark.parametrize(("here", "there"), [(-1.0, 0.7), (0.7, -1.0)])
def test_when_nothing_is_left_the_map_is_that_of_the_larger_room(explorer, monkeypatch, here, there):
    walls = [wall_points((x, -1), (x, 1)) for x in (-3.0, 0.0, 1.5)]
    explorer.surface_map.update(np.vstack([ground_points(flat, (-3, 1.5), (-1, 1)), *walls]))
    surface = drivable_surface(explorer.surface_map)
    explorer._track = np.column_stack([np.linspace(there, here, 100), np.zeros(100)])
    monkeypatch.setattr(explorer, "_next_view", lambda *look: None)
    view, kept, _ = explorer._view_beyond(surface, ShortestPaths(surface, (here, 0.0)), np.eye(4))
    assert view is None
    assert kept.reachable[tuple(surface.grid.cell_of([-1.0, 0.0]))]
