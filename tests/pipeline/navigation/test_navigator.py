from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.navigation.commands import Approach, Outcome, Verdict
from pipeline.navigation.config import ProgressConfig, RecoveryConfig
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import OVERDUE_RAMP, Halt
from pipeline.planning.stretches import stretches_of
from pipeline.robot import Velocity
from pipeline.transforms import from_yaw, wrap_angle, yaw_of
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.navigation.follower import Follower
from tests.pipeline.robot_model import PIONEER

BACKED_OUT = RecoveryConfig().max_distance
coordinates = st.floats(-3, 3)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=3), st.floats(-np.pi, np.pi))
def test_it_reaches_its_waypoints_and_its_heading(waypoints, heading):
    robot = KinematicRobot()
    assert Follower(robot).drive(np.array(waypoints), heading)
    assert np.linalg.norm(robot.T[:2, 3] - waypoints[-1]) < 0.06
    assert abs(wrap_angle(yaw_of(robot.T) - heading)) < np.deg2rad(3)


@pytest.mark.parametrize(("target", "sign"), [((0, 1), 1), ((0, -1), -1), ((-1, 0.1), 1), ((-1, -0.1), -1)])
def test_it_turns_the_shorter_way(target, sign):
    robot = KinematicRobot()
    Follower(robot).drive(np.array([target]))
    turning = [c.omega for c in robot.commands if c.v == 0 and c.omega != 0]
    assert np.all(np.sign(turning) == sign)


def test_the_wider_the_angle_the_faster_the_turn():
    robot = KinematicRobot()
    Follower(robot).drive(np.array([(-1, 0.001)]))
    turning = [c.omega for c in robot.commands if c.v == 0 and c.omega != 0]
    assert turning[0] == PIONEER.turn_rate
    assert np.all(np.diff(turning) <= 0)
    assert turning[-1] < 0.2


def test_it_drives_at_the_speed_of_the_thesis_and_slower_on_ramps():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(16) if 1 < x < 2 else 0.0)
    speeds = []
    navigator = Follower(robot)
    robot_drive = robot.drive

    def spy(command):
        speeds.append((robot.T[0, 3], command.v))
        return robot_drive(command)

    robot.drive = spy
    assert navigator.drive(np.array([(3, 0)]))
    assert {v for x, v in speeds if 0.1 < x < 0.9} == {0.2}
    assert {v for x, v in speeds if 1.1 < x < 1.9} == {0.15}
    assert max(v for _, v in speeds) == 0.2


def test_it_slows_down_to_the_pace_of_the_ground_ahead():
    robot = KinematicRobot()
    navigator = Follower(robot)

    def speed_along(stretch):
        x = stretch.poses[:, 0]
        return np.where((x > 1) & (x < 2), 0.1, np.inf)

    assert navigator.drive(np.array([(3.0, 0.0)]), speed_along=speed_along)
    speeds = [c.v for c in robot.commands]
    assert speeds.count(0.1) * robot.control_period > 9
    assert max(speeds) == PIONEER.speed


def test_it_follows_the_line_not_only_the_bearing():
    robot = KinematicRobot()
    drift = robot.drive
    tracks = []

    def crosswind(command):
        if 0.5 < robot.T[0, 3] < 0.6:
            robot.T[1, 3] += 0.004
        tracks.append(robot.T[:2, 3].copy())
        return drift(command)

    robot.drive = crosswind
    assert Follower(robot).drive(np.array([(2.5, 0)]))
    tracks = np.array(tracks)
    assert np.abs(tracks[:, 1]).max() > 0.03
    assert np.abs(tracks[tracks[:, 0] > 1.8, 1]).max() < 0.01


def test_stuck_is_noticed_and_the_robot_backs_out():
    robot = KinematicRobot(blocked=lambda time: 3 < time < 3.5)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0), (2, 2)]))
    assert [leg.outcome for leg in navigator.legs] == [Outcome.STUCK]
    assert robot.commands[-2].v < 0
    assert navigator.recoveries == 1
    assert robot.commands[-1].v == 0
    (halt,) = navigator.halts
    assert halt.command.v > 0
    assert halt.has_backed_out
    assert robot.T[0, 3] == pytest.approx(halt.T_map_base[0, 3] - BACKED_OUT, abs=0.04)


def test_it_pushes_for_less_than_a_second():
    robot = KinematicRobot(blocked=lambda time: time > 3)
    Follower(robot).drive(np.array([(2, 0)]))
    pushing = [c for c in robot.commands[60:] if c.v > 0]
    assert len(pushing) * robot.control_period < 1
    backing = [c for c in robot.commands if c.v < 0]  # held while backing out as well, it gives up as soon
    assert len(backing) * robot.control_period < 1.5


def test_a_robot_that_is_held_on_both_sides_is_not_freed():
    robot = KinematicRobot(blocked=lambda time: time > 3)
    navigator = Follower(robot)
    navigator.drive(np.array([(2, 0)]))
    assert [halt.has_backed_out for halt in navigator.halts] == [False]


class RobotBeforeWall(KinematicRobot):
    """It follows a command no faster than it accelerates; it can get no farther along x than ``wall``, m."""

    def __init__(self, wall, pitch=lambda x, y: 0.0):
        super().__init__(pitch)
        self._wall, self._speeds = wall, np.zeros(2)

    def drive(self, command):
        most = np.array([self.model.acceleration, self.model.turn_acceleration]) * self.control_period
        self._speeds += np.clip((command.v, command.omega) - self._speeds, -most, most)
        v, omega = self._speeds
        is_held = self.T[0, 3] >= self._wall and v > 0
        return super().drive(replace(command, v=0.0 if is_held else v, omega=omega))


@pytest.mark.parametrize(
    ("verdict", "target", "heading"),
    [
        (Verdict.BLOCKED, [(2.0, 0.0)], None),
        (Verdict.UNSURE, [(2.0, 0.0)], None),
        (Verdict.DONE, np.zeros((0, 2)), np.deg2rad(160)),
    ],
)
def test_a_robot_that_breaks_off_stands_still_where_the_next_plan_begins(verdict, target, heading):
    robot = RobotBeforeWall(np.inf)
    navigator = Follower(robot)

    def watch(command):
        return verdict if robot.T[0, 3] > 0.5 or yaw_of(robot.T) > 0.8 else Verdict.FINE

    navigator.drive(target, heading, watch=watch)
    before = navigator.stopping_pose(navigator.T_map_base)
    for _ in range(20):
        navigator.send(Velocity())
    np.testing.assert_allclose(navigator.stopping_pose(navigator.T_map_base), before, atol=0.002)


def test_a_robot_that_never_seems_to_stand_still_may_be_halted():
    robot = KinematicRobot()
    navigator, drive = Follower(robot), robot.drive
    robot.drive = lambda command: replace(drive(command), wheel_speed=np.ones(2))
    assert navigator.halt(navigator.send) is Outcome.REACHED


def test_it_backs_out_once_its_wheels_have_come_to_rest():
    navigator = Follower(RobotBeforeWall(0.6))
    assert not navigator.drive(np.array([(2, 0)]))
    assert [halt.has_backed_out for halt in navigator.halts] == [True]
    assert navigator.robot.T[0, 3] == pytest.approx(0.6 - BACKED_OUT, abs=0.02)


def test_it_backs_out_no_farther_than_it_came():
    navigator = Follower(RobotBeforeWall(0.05))
    assert not navigator.drive(np.array([(2, 0)]))
    assert np.min(navigator.track, axis=0)[0] > -0.01


def test_it_drives_back_by_the_distance_that_it_is_given():
    robot = RobotBeforeWall(np.inf)
    navigator = Follower(robot)
    navigator.send(Velocity())
    navigator.halts = [Halt(navigator.T_map_base, Velocity(0.2), False)]
    assert navigator.drive_back(navigator.send)
    assert robot.T[0, 3] == pytest.approx(-BACKED_OUT, abs=0.01)


@pytest.mark.parametrize(("ahead", "is_held"), [(0.0, False), (0.05, False), (0.2, True)])
def test_it_is_still_held_if_the_camera_sees_it_where_it_was(ahead, is_held):
    navigator = Follower(RobotBeforeWall(0.6))
    assert not navigator.drive(np.array([(2, 0)]))
    assert navigator.halts[-1].backed_distance == pytest.approx(BACKED_OUT, abs=0.02)
    assert navigator.is_still_held(from_yaw(ahead, 0, 0, 0)) is is_held


@pytest.mark.parametrize("turned", [90, 120, 150])
def test_it_backs_out_as_far_where_arcs_have_turned_it_round(turned):
    robot = KinematicRobot(blocked=lambda time: yaw_of(robot.T) > np.deg2rad(turned) and robot.commands[-1].v > 0)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(1.2, 0.0), (1.2, 1.2), (-0.5, 1.2)]), arcs=True)
    (halt,) = navigator.halts
    assert halt.has_backed_out
    assert np.linalg.norm(robot.T[:2, 3] - halt.T_map_base[:2, 3]) == pytest.approx(BACKED_OUT, abs=0.04)


@pytest.mark.parametrize(("step", "shift"), [(6, 0.03), (40, 0.18)])
def test_a_correction_of_the_map_is_no_sign_of_being_held(step, shift):
    navigator, looks = Follower(KinematicRobot()), count()

    def look(command):
        navigator.correct(from_yaw(-shift if next(looks) >= step else 0.0, 0, 0, 0))
        return Verdict.FINE

    assert navigator.drive(np.array([(2, 0)]), watch=look)
    assert not navigator.halts


def test_on_a_ramp_it_has_time_to_break_loose():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(16), blocked=lambda time: 3 < time < 5)
    assert Follower(robot).drive(np.array([(1, 0)]))


def test_a_turn_that_is_blocked_is_turned_back():
    robot = KinematicRobot(blocked=lambda time: 1 < time < 2)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(0, 2)]))
    assert navigator.legs[-1].outcome is Outcome.STUCK
    assert navigator.halts[-1].command.v == 0
    assert robot.commands[-2].omega < 0 < robot.commands[5].omega


def test_a_blocked_look_is_a_leg_that_failed():
    robot = KinematicRobot(blocked=lambda time: time > 6)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(1, 0)]), heading=3.0)
    assert [leg.outcome for leg in navigator.legs] == [Outcome.STUCK]


def stops(robot):
    """Numbers of the commands, but the first and the last, by which the robot stands."""
    return [k for k, command in enumerate(robot.commands[2:-1]) if command == Velocity()]


def test_where_there_is_room_it_turns_while_it_drives():
    corners = np.array([(1.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
    for arcs in (True, False):
        robot = KinematicRobot()
        navigator = Follower(robot)
        assert navigator.drive(corners, np.deg2rad(60), arcs=arcs, may_roll=arcs)
        assert navigator.halt(navigator.send) is Outcome.REACHED
        pivots = any(command.omega and not command.v for command in robot.commands)
        assert pivots != arcs
        np.testing.assert_allclose(robot.T[:2, 3], corners[-1], atol=0.06)
        assert abs(yaw_of(robot.T) - np.deg2rad(60)) < np.deg2rad(10)


def test_it_rolls_through_the_end_of_a_way_that_it_passes():
    robot = KinematicRobot()
    navigator = Follower(robot)
    assert navigator.drive([(1.0, 0.0)], 0.0, arcs=True, may_roll=True)
    assert robot.commands[-1].v > 0
    ahead = navigator.stopping_pose(navigator.T_map_base)
    np.testing.assert_allclose(ahead, (1.0, 0.0, 0.0), atol=0.02)
    way = stretches_of(np.array([(2.0, 0.0)]), np.zeros(1, np.bool_), ahead, None, lambda poses: True)
    assert navigator.follow(Course(way), navigator.send) is Outcome.REACHED
    assert not stops(robot)
    np.testing.assert_allclose(robot.T[:2, 3], (2.0, 0.0), atol=0.06)


def test_a_robot_that_rolls_goes_to_the_end_before_it_turns_back():
    robot = KinematicRobot()
    navigator = Follower(robot)
    assert navigator.drive([(1.0, 0.0)], 0.0, may_roll=True)
    ahead = navigator.stopping_pose(navigator.T_map_base)
    way = stretches_of(np.array([(0.0, 0.0)]), np.zeros(1, np.bool_), ahead, None, lambda poses: False)
    assert navigator.follow(Course(way), navigator.send) is Outcome.REACHED
    assert max(place[0] for place in navigator.track) == pytest.approx(1.0, abs=0.06)
    np.testing.assert_allclose(robot.T[:2, 3], (0.0, 0.0), atol=0.06)


def test_a_drive_that_is_done_before_its_end_goes_on_with_the_next_one():
    robot = KinematicRobot()
    navigator = Follower(robot)
    assert navigator.drive([(3.0, 0.0)], watch=lambda c: Verdict.FINE if robot.T[0, 3] < 1 else Verdict.DONE)
    assert [leg.outcome for leg in navigator.legs] == [Outcome.REACHED]
    x, y, heading = navigator.stopping_pose(navigator.T_map_base)
    assert 1.0 < x < 1.2
    assert abs(y) + abs(heading) < 0.01
    assert navigator.halt(navigator.send) is Outcome.REACHED
    np.testing.assert_allclose(robot.T[:2, 3], (x, y), atol=0.06)
    assert robot.commands[-1] == Velocity()


def test_a_robot_that_was_lifted_stops():
    robot = KinematicRobot()
    drive = robot.drive

    def kidnapped(command):
        if len(robot.commands) == 60:
            robot.T = from_yaw(3, 3, 0, 1)
        return drive(command)

    robot.drive = kidnapped
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0), (2, 2)]))
    assert [leg.outcome for leg in navigator.legs] == [Outcome.CARRIED]
    assert not navigator.halts
    assert robot.commands[-1] == Velocity()
    np.testing.assert_allclose(robot.T[:2, 3], (3, 3), atol=0.02)


@pytest.mark.parametrize("seconds", [0.25, 5.0])
def test_time_that_goes_on_while_a_keyframe_is_mapped_is_nothing_strange(seconds):
    robot = KinematicRobot()
    navigator = Follower(robot)
    looks = count()

    def look(command):
        # The robot rolls on, stands, and then turns a little.
        if next(looks) % 40 == 30:
            for _ in range(round(seconds / robot.control_period)):
                robot.drive(Velocity(PIONEER.speed if seconds < 2 else 0.0))
        return Verdict.FINE

    assert navigator.drive(np.array([(1.5, 0), (1.5, 1)]), 0.0, watch=look)
    assert [leg.outcome for leg in navigator.legs] == [Outcome.REACHED] * 2


def test_a_slow_drive_is_no_blocked_one():
    robot = KinematicRobot()
    drive = robot.drive
    robot.drive = lambda command: drive(Velocity(0.6 * command.v, 0.6 * command.omega))
    assert Follower(robot).drive(np.array([(1, 0), (1, 1)]), 0.0)


def test_it_stops_before_it_tips():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(30) if x > 1 else 0.0)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0)]))
    assert navigator.legs[-1].outcome is Outcome.TILTED
    assert robot.T[0, 3] < 1


@pytest.mark.parametrize("below", [0.0, -np.deg2rad(16)])
def test_a_robot_that_leans_too_far_goes_back_until_it_is_level(below):
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(30) if x > 1 else below if x > 0.4 else 0.0)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0)]))
    assert navigator.legs[-1].outcome is Outcome.TILTED
    assert navigator.halts[-1].has_backed_out
    assert robot.T[0, 3] == pytest.approx(0.3 if below else 1.0 - BACKED_OUT, abs=0.11)


def test_a_robot_that_backs_onto_something_comes_down_again():
    steepness, place = np.deg2rad(400), 0.58  # rad of pitch per m that it backs past this place, m
    robot = RobotBeforeWall(0.6, lambda x, y: steepness * (place - x) if backs(robot) and x < place else 0.0)
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0)]))
    assert [halt.has_backed_out for halt in navigator.halts] == [False]
    after = np.array(navigator.track)[[c.v < 0 for c in robot.commands].index(True) :, 0]
    assert after.min() > place - (PIONEER.tipping_tilt / steepness + 0.03)  # it brakes
    assert after[-1] > place - 0.02


def backs(robot):
    return any(command.v < 0 for command in robot.commands)


def test_it_does_not_back_out_on_wheels_that_spin():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(30) if x > 1 else -np.deg2rad(16))
    navigator = Follower(robot)

    def look(command):
        return Verdict.SPINNING if backs(robot) else Verdict.FINE

    assert not navigator.drive(np.array([(2, 0)]), watch=look)
    assert [halt.has_backed_out for halt in navigator.halts] == [False]
    assert sum(command.v < 0 for command in robot.commands) == 1


def test_on_a_ramp_it_backs_where_asked():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(16) if x > 1 else 0.0)
    navigator = Follower(robot)
    assert navigator.drive(np.array([(1.4, 0)]))
    before = len(robot.commands)
    assert navigator.drive(np.array([(0.5, 0.05)]), backwards=np.array([True]))
    backing = robot.commands[before:]
    assert min(c.v for c in backing) < 0 <= max(abs(c.omega) for c in backing) < 0.3
    assert abs(yaw_of(robot.T)) < np.deg2rad(10)
    np.testing.assert_allclose(robot.T[:2, 3], (0.5, 0.05), atol=0.06)


def test_on_a_ramp_it_turns_slowly_where_the_way_leads_across():
    robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(16))
    navigator = Follower(robot, hold_gain=0.0)
    assert navigator.drive(np.array([(0.5, 0.0), (0.5, 0.5)]))
    turning = [c.omega for c in robot.commands if c.v == 0 and c.omega != 0]
    assert max(turning) == PIONEER.ramp_turn_rate
    np.testing.assert_allclose(robot.T[:2, 3], (0.5, 0.5), atol=0.06)


def test_way_points_are_in_map_whatever_odom_is():
    robot = KinematicRobot()
    navigator = Follower(robot)
    navigator.correct(from_yaw(5, 5, 0, np.pi / 2))
    assert navigator.drive(np.array([(5, 6)]))
    np.testing.assert_allclose(robot.T[:2, 3], (1, 0), atol=0.06)


def test_it_backs_up_to_the_last_way_point_where_asked():
    robot = KinematicRobot()
    assert Follower(robot).drive(np.array([(1, 0), (1, 2)]), backwards=np.array([False, True]))
    np.testing.assert_allclose(robot.T[:2, 3], (1, 2), atol=0.06)
    assert abs(wrap_angle(yaw_of(robot.T) + np.pi / 2)) < np.deg2rad(3)
    assert min(c.v for c in robot.commands) < 0 < max(c.v for c in robot.commands)


@pytest.mark.parametrize("pitch", [0.0, -np.deg2rad(16)])
@pytest.mark.parametrize("back_up", [True, False])
def test_it_looks_back_or_ahead_at_the_end_as_asked_even_if_the_other_were_nearer(back_up, pitch):
    robot = KinematicRobot(pitch=lambda x, y: pitch)
    assert Follower(robot, hold_gain=0.0).drive(
        np.array([(0.5 if back_up else -0.5, 0.0)]), backwards=np.array([back_up])
    )
    assert abs(wrap_angle(yaw_of(robot.T) - np.pi)) < np.deg2rad(3)


def test_a_robot_that_was_kidnapped_since_the_step_does_not_follow_the_old_plan():
    robot = KinematicRobot()
    navigator = Follower(robot)
    assert not navigator.drive(np.array([(2, 0)]), start=np.array([5.0, 5.0]))
    assert [leg.outcome for leg in navigator.legs] == [Outcome.CARRIED]
    assert not any(command.v or command.omega for command in robot.commands)
    assert navigator.drive(np.array([(1, 0)]), start=np.array([0.0, 0.05]))


def test_it_stops_before_what_blocks_its_way():
    robot = KinematicRobot()
    navigator, asked = Follower(robot), set()

    def watch(command):
        if isinstance(command, Approach):
            asked.add(tuple(command.path[-1]))
        return Verdict.FINE if robot.T[0, 3] < 0.8 else Verdict.BLOCKED

    assert not navigator.drive(np.array([(0, 0.5), (2, 0.5), (2, 2)]), watch=watch)
    assert [leg.outcome for leg in navigator.legs] == [Outcome.REACHED, Outcome.BLOCKED]
    assert 0.8 <= robot.T[0, 3] < 0.85
    assert robot.commands[-1] == Velocity()
    assert asked == {(0, 0.5), (2, 0.5)}


def test_it_turns_before_it_approaches():
    navigator = Follower(KinematicRobot())
    clear = {True: Verdict.BLOCKED, False: Verdict.FINE}
    assert not navigator.drive(np.array([(-1, 0)]), watch=lambda command: clear[isinstance(command, Approach)])
    assert navigator.legs[0].outcome is Outcome.BLOCKED
    assert abs(wrap_angle(yaw_of(navigator.T_map_base) - np.pi)) < np.deg2rad(3)


def test_a_turn_ends_although_the_robot_slides_around_its_way_point():
    robot = KinematicRobot(pitch=lambda x, y: np.deg2rad(-16))
    navigator, drive = Follower(robot, hold_gain=0.0), robot.drive

    def slide(command):
        motion = drive(command)
        if command.omega != 0 and command.v == 0:
            # The robot slides so that the way point stays to its left, or to its right.
            aside = yaw_of(robot.T) - np.sign(command.omega) * np.pi / 2
            robot.T[:2, 3] = np.array([0.0, 0.1]) + 0.1 * np.array([np.cos(aside), np.sin(aside)])
        return motion

    robot.drive = slide
    assert navigator.drive(np.array([(0.0, 0.1)]))
    assert len(robot.commands) * robot.control_period < 30


@pytest.mark.parametrize(("slide", "is_driven"), [(0.03, True), (0.2, False)])
def test_a_stretch_off_which_the_robot_slid_in_the_turn_to_it_is_not_begun(slide, is_driven):
    robot = KinematicRobot()
    navigator, drive = Follower(robot), robot.drive
    has_slid = iter([True])

    def sliding(command):
        if command.omega != 0 and next(has_slid, False):
            robot.T[0, 3] += slide
        return drive(command)

    robot.drive = sliding
    assert navigator.drive(np.array([(0.0, 1.0)])) == is_driven
    assert [leg.outcome for leg in navigator.legs] == [Outcome.REACHED if is_driven else Outcome.SLID]
    assert (robot.T[1, 3] > 0.9) == is_driven


def test_a_leg_on_which_the_robot_slides_back_again_and_again_is_given_up():
    robot = KinematicRobot(pitch=lambda x, y: np.deg2rad(-16))
    navigator, drive = Follower(robot, hold_gain=0.0), robot.drive

    def slide(command):
        if robot.T[0, 3] > 0.1:
            robot.T[0, 3] = 0.0
        return drive(command)

    robot.drive = slide
    assert not navigator.drive(np.array([(0.6, 0.0)]))
    assert navigator.legs[-1].outcome is Outcome.STUCK
    slow = ProgressConfig()
    limit = slow.max_delay + OVERDUE_RAMP * 0.6 / PIONEER.ramp_speed
    assert limit < navigator.motion.time < limit + 10


def test_a_turn_that_makes_up_for_sliding_is_not_held_where_the_ramp_ends():
    robot = KinematicRobot(pitch=lambda x, y: 0.0 if len(robot.commands) > 40 else -np.deg2rad(16))
    navigator, drive = Follower(robot), robot.drive

    def slide(command):
        robot.T[:2, 3] -= command.v * robot.control_period * robot.T[:2, 0]
        if len(robot.commands) == 40:
            robot.T[:2, 3] += 0.12 * robot.T[:2, 1]
        return drive(command)

    robot.drive = slide
    navigator.drive(np.array([(0.0, 0.0)]), np.deg2rad(170))
    assert any(abs(command.v) > 0.05 for command in robot.commands[20:40])
    assert navigator.halts == []


def test_a_wide_turn_on_a_ramp_makes_up_for_no_more_sliding_than_a_quarter_turn():
    speeds = []
    for heading in (np.pi / 4, np.pi / 2, np.deg2rad(179)):
        robot = KinematicRobot(pitch=lambda x, y: -np.deg2rad(8))
        Follower(robot).drive(np.zeros((0, 2)), heading)
        speeds.append(next(command.v for command in robot.commands if command.omega))
    assert 0 < speeds[0] < speeds[1] == pytest.approx(speeds[2])


@pytest.mark.parametrize("pitch", [0.0, -np.deg2rad(16)])
def test_what_it_touched_stands_right_before_the_end_that_went_ahead(pitch):
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_euler("y", pitch).as_matrix()
    for v, end in ((0.2, 1), (-0.2, -1)):
        points = Halt(from_yaw(1, 2, 0, np.pi / 2) @ tilt, Velocity(v), True).contact_points(PIONEER, cell=0.05)
        np.testing.assert_allclose(points[:, 1], 2 + end * (PIONEER.half_length + 0.05 / np.sqrt(2)))
        np.testing.assert_allclose(np.ptp(points[:, 0]), PIONEER.width, rtol=1e-6)
        np.testing.assert_allclose(points[:, 2], PIONEER.body_height)
