from dataclasses import replace

import numpy as np
import pytest

from pipeline.config import ExplorerConfig, PipelineConfig
from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.mission import Goals
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer, probable_contact_points
from pipeline.frame import Frame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.mapper import Mapper
from pipeline.navigation.commands import Outcome
from pipeline.navigation.navigator import DrivenLeg, Halt
from pipeline.planning.path_plan import PathPlan
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import WALL, StillRobot
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points


class PlacedRobot(StillRobot):
    """A robot that stays where it was put, whatever the commands."""

    def __init__(self):
        super().__init__()
        self.T = np.eye(4)

    def sense(self) -> Frame:
        return replace(super().sense(), T_odom_base=self.T)


def ends_in(explorer, outcome, *halts):
    """Let every drive end at once, and know where the robot stands."""
    navigator = explorer.pilot.navigator

    def follow(way, *rest, **options):
        navigator.legs.append(DrivenLeg(np.zeros(2), outcome))
        navigator.halts += halts
        return outcome

    navigator.follow = follow
    navigator.add_motion(explorer.pilot.robot.drive(Velocity()))


@pytest.fixture
def explorer():
    config = PipelineConfig(explorer=ExplorerConfig(max_failed_drives=3))
    return Explorer(
        PlacedRobot(), Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation(), config=config)
    )


@pytest.mark.parametrize("freed", [True, False])
def test_what_holds_the_robot_is_an_obstacle_once_it_got_away(explorer, freed):
    ends_in(explorer, Outcome.STUCK, Halt(np.eye(4), Velocity(0.2), freed))
    step = explorer.step()
    assert step.traversability.grid.at(step.traversability.traversable, [0.3, 0.0])
    ahead = PathPlan(np.array([(1.2, 0.0, 0.0)]), np.array([False]), [], 1.2)
    viewpoint = Viewpoint(np.array([1.2, 0.0]), 0.0, turn=False, gain=1.0)
    assert not explorer.drive(replace(step, plan=ahead, viewpoint=viewpoint))
    traversability = explorer.step().traversability
    assert traversability.grid.at(traversability.hazard, [0.29, 0.0]) == freed
    assert np.isfinite(traversability.line_seconds([(-0.1, 0.0)], [(1.0, 0.0)])[0]) != freed


def test_a_corner_that_touched_a_wall_does_not_close_the_passage():
    halt = Halt(np.eye(4), Velocity(0.2), True)
    ground = ground_points(flat, (-2, 2), (-0.9, 0.9))
    corner = surface_of(ground, wall_points((0.3, -0.9), (0.3, -0.2)))
    points = probable_contact_points(halt, assess_map(corner))
    assert len(points) and points[:, 1].max() < 0  # the other half of the front stays free
    assert points[:, 1].min() < -0.2
    whole = probable_contact_points(halt, assess_map(surface_of(ground)))
    np.testing.assert_array_equal(whole, halt.contact_points(PIONEER, 0.05))  # nothing explains it


@pytest.mark.parametrize("moved", [(5.0, 5.0), (0.0, 0.1)])
def test_ground_is_level_wherever_the_robot_is_set_down(explorer, moved):
    explorer.step()
    explorer.pilot.robot.T = from_yaw(*moved, 0, np.pi)
    step = explorer.step()
    assert step.traversability.grid.at(step.traversability.traversable, moved)
    assert step.was_carried == (moved == (5.0, 5.0))


@pytest.mark.parametrize("outcome", [Outcome.UNSURE, Outcome.CARRIED])
def test_a_robot_that_stopped_in_doubt_was_not_carried(explorer, outcome):
    ends_in(explorer, outcome)
    explorer.drive(explorer.step())
    assert explorer.step().was_carried == (outcome is Outcome.CARRIED)


def test_a_robot_that_was_not_lifted_trusts_what_it_saw(explorer):
    explorer.step()
    known = explorer.mapper.elevation_map.elevation.copy()
    robot, blank = explorer.pilot.robot, np.zeros((120, 160), np.float32)
    robot.T = from_yaw(-0.25, 0.0, 0, np.pi)
    robot.sense = lambda sense=robot.sense: replace(sense(), depth=blank)
    explorer.step()
    assert np.isnan(explorer.mapper.elevation_map.elevation[np.isnan(known)]).all()


def test_a_robot_that_is_held_again_and_again_stays(explorer):
    ends_in(explorer, Outcome.STUCK)
    steps = [explorer.step()]
    while steps[-1].plan is not None and len(steps) < 20:
        explorer.drive(steps[-1])
        steps.append(explorer.step())
    assert len(steps) == 1 + 3
    assert steps[0].can_drive and not steps[-1].can_drive


def test_ways_to_goals_need_no_margin_once_nothing_else_is_left(explorer):
    explorer.step()
    explorer.mission.goals = Goals([(1.2, 0.0)])
    assert not explorer.step().traversability.ignores_margin
    explorer.mission.goals = Goals([(WALL, 0.0)])
    step = explorer.step()
    assert step.viewpoint is None and step.traversability.ignores_margin and explorer.mission.goals.ignores_margin
    explorer.mission.goals = None
    assert not explorer.step().traversability.ignores_margin


def test_it_does_without_room_downhill_only_if_there_is_no_other_way(explorer, monkeypatch):
    def falls_to_the_right(x, y):
        return 0.28 * y * np.interp(x, [0.5, 2, 3, 4.5], [0, 1, 1, 0])

    sides = -PIONEER.half_width - 0.08, PIONEER.half_width + 0.03  # of a passage across the slope
    walls = [wall_points((2, y), (3, y)) for y in sides]
    walls += [wall_points((x, y), (x, np.sign(y))) for x in (2, 3) for y in sides]
    walls += [wall_points((-1, y), (6, y)) for y in (-1, 1)] + [wall_points((x, -1), (x, 1)) for x in (-1, 6)]
    explorer.mapper.elevation_map.update(np.vstack([ground_points(falls_to_the_right, (-1, 6), (-1, 1)), *walls]))
    robot = explorer.pilot.robot
    robot.sense = lambda sense=robot.sense: replace(sense(), depth=np.zeros((120, 160), np.float32))
    explorer.mission.goals = Goals([(1.0, 0.0), (5.0, 0.0)])
    near = explorer.step()
    assert near.plan is not None and not near.traversability.ignores_downhill_room
    explorer.mission.goals = Goals([(5.0, 0.0)])
    # A robot that has slid to where it has no room drives back first. Where it chose to do without room, it goes on.
    back = PathPlan(np.array([(0.5, 0.0, 0.0)]), np.array([True]), [], 0.5)
    monkeypatch.setattr("pipeline.explorer.way_back", lambda poses, paths: back)
    assert explorer.step().plan is back
    monkeypatch.setattr("pipeline.explorer.way_back", lambda poses, paths: None)
    far = explorer.step()
    assert far.plan is not None and far.traversability.ignores_downhill_room
    monkeypatch.setattr("pipeline.explorer.way_back", lambda poses, paths: back)
    assert explorer.step().traversability.ignores_downhill_room


def test_goals_that_were_seen_come_before_views_and_views_only_as_long_as_goals_are_left(explorer):
    explorer.step()
    explorer.mission.goals = Goals([(9.0, 9.0), (1.2, 0.0)])
    viewpoint = explorer.step().viewpoint
    np.testing.assert_allclose(viewpoint.position, (1.2, 0.0))
    explorer.pilot.robot.T = from_yaw(1.2, 0.0, 0, np.pi)
    assert explorer.step().viewpoint.gain > 0
    assert len(explorer.mission.goals.remaining) == 1
    explorer.mission.may_explore = False  # which limits exploring, not the way to a goal
    assert explorer.step().viewpoint is not None
    explorer.mission.goals = Goals([])
    assert explorer.step().viewpoint is None


def test_a_step_can_be_redirected_to_a_viewpoint_from_outside(explorer):
    step = explorer.step()
    other = Viewpoint(np.array([1.2, 0.0]), 0.0, True, 0.0)
    redirected = explorer.redirect(step, other)
    assert redirected.viewpoint is other and redirected.keyframe is step.keyframe
    np.testing.assert_allclose(redirected.plan.waypoints[-1, :2], other.position, atol=0.05)
    assert explorer.redirect(step, replace(other, position=np.array([50.0, 0.0]))).plan is None
