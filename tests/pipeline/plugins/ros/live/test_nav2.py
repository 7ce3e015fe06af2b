"""A robot whose Nav2 stack drives it: what is asked of it, when a drive ends, and that it ends."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from pipeline.arrays import Pose
from pipeline.config import PipelineConfig
from pipeline.errors import InputError
from pipeline.localisation.config import KeyframePolicy, LocalisationConfig
from pipeline.localisation.localisation import LostError
from pipeline.mapper import Mapper, sense_and_map
from pipeline.navigation.commands import Outcome, Verdict
from pipeline.navigation.config import NavigationConfig
from pipeline.navigation.course import Course
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.pilot import Pilot
from pipeline.planning.stretches import Stretch, stretches_of
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.config import Nav2Config
from pipeline.plugins.ros.live.actions import GoalEnd
from pipeline.plugins.ros.live.nav2 import Nav2Navigator, Nav2Robot
from pipeline.plugins.ros.live.topic_names import TopicNames
from pipeline.robot import Velocity
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.sensor import XTION
from pipeline.transforms import from_yaw, inverse, transform_points, wrap_angle, yaw_of
from tests.pipeline.localisation.driving_robot import T_BASE_CAMERA
from tests.pipeline.plugins.ros.live.loopback import End, RoomRobot, Wire
from tests.pipeline.plugins.ros.live.nav2_stack import Nav2Stack
from tests.pipeline.robot_model import PIONEER

Watch = Callable[[Velocity], Verdict]
SOON = Nav2Config(patience=1.0, min_speed=1.0)


class Drive:
    """A robot in a room, its Nav2, and a navigator that sends it to places."""

    def __init__(self, T_map_odom: Pose = from_yaw(0, 0, 0, 0), nav2: Nav2Config = Nav2Config()):
        self.wire = Wire()
        self.room, self.stack = RoomRobot(self.wire, every=20), Nav2Stack(self.wire)
        self.end = End(self.wire, "explorer")
        self.end.work = self.room.period
        self.robot = Nav2Robot(self.end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0)
        self.navigator = Nav2Navigator(self.robot, nav2=nav2)
        self.navigator.correct(T_map_odom)

    def to(self, place: Any, heading: float | None, watch: Watch = lambda command: Verdict.FINE) -> Outcome:
        """Drive to a place in the map, and how that ends."""
        if self.navigator.motion is None:
            self.navigator.add_motion(self.robot.drive(Velocity()))
        course = Course(way_to(self.navigator.T_map_base, place), heading)
        return self.navigator.follow(course, partial(self.send, watch=watch))

    def send(self, command: Velocity, watch: Watch = lambda command: Verdict.FINE) -> Verdict:
        verdict = watch(command) if command != Velocity() else Verdict.FINE
        if verdict is Verdict.FINE:
            self.navigator.add_motion(self.robot.drive(command))
        return verdict

    def hold(self) -> None:
        """Keep the robot where it is, whatever it is commanded."""
        self.wire.takers["/cmd_vel"] = [("robot", lambda data: None)]

    def moves(self, seconds: float) -> bool:
        """Whether the robot moves within so many seconds."""
        before = self.room.body.T
        self.end.wait(lambda: False, seconds)
        return not np.allclose(self.room.body.T, before, atol=1e-3)


def way_to(T: Pose, place: Any) -> list[Stretch]:
    start = np.append(T[:2, 3], yaw_of(T))
    return stretches_of(np.array([place]), np.zeros(1, np.bool_), start, None, lambda poses: False)


@pytest.fixture
def drive() -> Drive:
    return Drive()


@pytest.mark.parametrize("T_map_odom", [from_yaw(0, 0, 0, 0), from_yaw(3.0, -1.0, 0.0, 2.0)])
def test_it_drives_to_a_place_of_our_map_and_turns_there(T_map_odom: Pose) -> None:
    drive = Drive(T_map_odom)
    place = transform_points(T_map_odom, np.array([[1.8, 1.5, 0.0]]))[0, :2]
    assert drive.to(place, 0.5 + yaw_of(T_map_odom)) is Outcome.REACHED
    np.testing.assert_allclose(drive.room.body.T[:2, 3], (1.8, 1.5), atol=0.06)
    assert abs(yaw_of(drive.room.body.T) - 0.5) < 0.1
    assert drive.stack.ends == [GoalEnd.SUCCEEDED]
    assert not drive.moves(1.0)


def test_a_viewpoint_where_it_stands_is_a_turn(drive: Drive) -> None:
    drive.navigator.add_motion(drive.robot.drive(Velocity()))
    assert drive.navigator.follow(Course([], 1.0), drive.send) is Outcome.REACHED
    assert drive.navigator.turn(np.pi, drive.send) is Outcome.REACHED
    T = drive.room.body.T
    assert abs(wrap_angle(yaw_of(T) - 1.0 - np.pi)) < 0.15
    np.testing.assert_allclose(T[:2, 3], (1.2, 1.0), atol=0.05)


def test_it_sends_no_velocities(drive: Drive) -> None:
    drive.to((1.8, 1.0), 0.0)
    drive.robot.stop()
    assert drive.wire.publishers["/cmd_vel"] == ["nav2"]


def test_a_goal_follows_the_corrections_of_the_map(drive: Drive) -> None:
    corrected = from_yaw(0.0, 0.4, 0.0, 0.1)

    def correct(command: Velocity) -> Verdict:
        if drive.room.body.T[0, 3] > 1.4:
            drive.navigator.correct(corrected)
        return Verdict.FINE

    assert drive.to((1.8, 1.5), 0.5, correct) is Outcome.REACHED
    expected = transform_points(inverse(corrected), np.array([[1.8, 1.5, 0.0]]))[0, :2]
    np.testing.assert_allclose(drive.room.body.T[:2, 3], expected, atol=0.06)
    assert drive.stack.ends == [GoalEnd.ABORTED, GoalEnd.SUCCEEDED]  # the first by the second


@pytest.mark.parametrize(
    ("verdict", "outcome"),
    [(Verdict.DONE, Outcome.REACHED), (Verdict.UNSURE, Outcome.UNSURE), (Verdict.SPINNING, Outcome.STUCK)],
)
def test_a_drive_ends_when_it_need_not_or_must_not_go_on(drive: Drive, verdict: Verdict, outcome: Outcome) -> None:
    def watch(command: Velocity) -> Verdict:
        return verdict if drive.room.body.T[0, 3] > 1.5 else Verdict.FINE

    assert drive.to((2.0, 1.0), 0.0, watch) is outcome
    assert drive.stack.ends == [GoalEnd.CANCELED]
    assert drive.room.body.T[0, 3] < 1.7
    assert not drive.moves(1.0)


def test_the_end_of_a_drive_is_asked_for_after_each_keyframe(drive: Drive) -> None:
    policy = KeyframePolicy(distance=0.2)
    mapper = Mapper(PIONEER, RuleClassifier(), config=PipelineConfig(LocalisationConfig(keyframes=policy)))
    pilot = Pilot(drive.robot, mapper, [], drive.navigator)
    sense_and_map(mapper, drive.robot.sense, pilot.confirm)
    asked: list[int] = []

    def is_done() -> bool:
        asked.append(len(mapper.keyframes))
        return len(mapper.keyframes) == 3

    drive.navigator.add_motion(drive.robot.drive(Velocity()))
    check = ObstacleCheck(mapper.traversability, XTION, NavigationConfig().obstacle_check)
    T = drive.navigator.T_map_base
    place = T[:2, 3] + 0.9 * T[:2, 0]
    assert pilot.follow(check, Course(way_to(T, place)), is_done=is_done) is Outcome.REACHED
    assert asked == [2, 3]
    assert drive.stack.ends == [GoalEnd.CANCELED]


def test_what_nav2_refuses_or_gives_up_is_a_failed_drive(drive: Drive, caplog: pytest.LogCaptureFixture) -> None:
    drive.hold()
    assert drive.to((1.8, 1.0), 0.0) is Outcome.BLOCKED
    assert "make progress" in caplog.text
    drive.stack.accepts = False
    assert drive.to((1.8, 1.0), 0.0) is Outcome.BLOCKED
    assert drive.stack.ends == [GoalEnd.ABORTED, GoalEnd.REJECTED]
    assert [leg.outcome for leg in drive.navigator.legs] == [Outcome.BLOCKED] * 2


def test_a_drive_that_does_not_end_is_ended() -> None:
    drive = Drive(nav2=SOON)
    drive.stack.patience = np.inf
    drive.hold()
    assert drive.to((1.8, 1.0), 0.0) is Outcome.STUCK
    assert drive.stack.ends == [GoalEnd.CANCELED]


def test_nav2_drives_on_while_the_pipeline_computes_until_it_is_stopped(drive: Drive) -> None:
    drive.navigator.add_motion(drive.robot.drive(Velocity()))
    commands = iter(3 * [Verdict.FINE])

    def send(command: Velocity) -> Verdict:
        drive.navigator.add_motion(drive.robot.drive(command))
        return next(commands)

    with pytest.raises(StopIteration):
        drive.navigator.follow(Course(way_to(from_yaw(1.2, 1.0, 0, 0), (3.0, 1.0))), send)
    assert drive.moves(1.0)
    drive.robot.stop()
    assert drive.stack.ends == [GoalEnd.CANCELED]
    assert not drive.moves(1.0)


def test_it_is_stopped_where_a_topic_falls_silent(drive: Drive) -> None:
    def ends(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
        return [] if topic == "/camera/depth/image_raw" else [(topic, time, message)]

    def watch(command: Velocity) -> Verdict:
        drive.wire.change = ends
        drive.robot.sense()
        return Verdict.FINE

    with pytest.raises(InputError, match="/camera/depth"):
        drive.to((3.0, 1.0), 0.0, watch)
    assert not drive.moves(1.0)


def test_a_robot_that_is_lost_right_after_a_goal_was_sent_is_stopped(drive: Drive) -> None:
    def watch(command: Velocity) -> Verdict:
        if drive.stack.goals:
            raise LostError("nothing fits")
        return Verdict.FINE

    with pytest.raises(LostError):
        drive.to((3.0, 1.0), 0.0, watch)
    drive.robot.stop()
    assert drive.stack.ends == [GoalEnd.CANCELED]


def namespaced(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    return [(f"/r1{topic}" if topic.startswith(("/odom", "/camera")) else topic, time, message)]


@pytest.mark.parametrize("name", ["/r1/navigate_to_pose", "/navigate_to_pose", "/r2/navigate_to_pose"])
def test_the_nav2_in_the_namespace_of_the_odometry_counts(name: str) -> None:
    wire = Wire()
    wire.change = namespaced
    room, end = RoomRobot(wire), End(wire, "explorer")
    end.work = room.period
    stack = Nav2Stack(wire, name, "/r1/odom")
    topics = TopicNames(*(f"/r1{topic}" for topic in vars(TopicNames()).values()))
    if name.startswith("/r2"):
        with pytest.raises(InputError, match=r"/r1/navigate_to_pose.* /r2/navigate_to_pose.*--topics.odom"):
            Nav2Robot(end, PIONEER, topics, T_BASE_CAMERA, patience=2.0)
        return
    robot = Nav2Robot(end, PIONEER, topics, T_BASE_CAMERA, patience=2.0)
    navigator = Nav2Navigator(robot)
    navigator.add_motion(robot.drive(Velocity()))
    commands = iter(3 * [Verdict.FINE])

    def send(command: Velocity) -> Verdict:
        navigator.add_motion(robot.drive(command))
        return next(commands)

    with pytest.raises(StopIteration):
        navigator.follow(Course([], 1.0), send)
    assert len(stack.goals) == 1


def test_whether_the_robot_has_another_map_is_said_by_its_transforms(drive: Drive) -> None:
    assert not drive.robot.has_map
    drive.room.end.publish("/tf", 0.0, messages.transforms(0.0, {("map", "odom"): np.eye(4)}))
    assert drive.robot.has_map
