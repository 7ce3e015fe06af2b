"""A robot by topics: what it senses, how it drives, and the errors when a topic fails."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.constants import g

from pipeline.datasets.links import FrameTree
from pipeline.errors import InputError
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.config import LiveConfig
from pipeline.plugins.ros.live.ros_robot import RosRobot
from pipeline.plugins.ros.live.topic_names import TopicNames
from pipeline.plugins.ros.messages import command_of
from pipeline.robot import Velocity
from pipeline.transforms import from_rotation
from tests.pipeline.localisation.driving_robot import T_BASE_CAMERA
from tests.pipeline.navigation.follower import Follower
from tests.pipeline.plugins.ros.live.loopback import Change, End, RoomRobot, Wire, unchanged
from tests.pipeline.robot_model import PIONEER

DEPTH, COLOUR, INFO, ODOM = "/camera/depth/image_raw", "/camera/color/image_raw", "/camera/depth/camera_info", "/odom"


def met_on(wire: Wire, kind: str = "geometry_msgs/msg/Twist") -> tuple[RoomRobot, End]:
    """A robot in a room, and the end of what is to drive it."""
    room, end = RoomRobot(wire, kind), End(wire, "explorer")
    end.work = room.period
    return room, end


class Pair:
    """A robot in a room, and what drives it by topics."""

    def __init__(
        self,
        kind: str = "geometry_msgs/msg/Twist",
        T_base_camera: Any = T_BASE_CAMERA,
        config: LiveConfig = LiveConfig(),
    ):
        self.wire = Wire()
        self.room, self.end = met_on(self.wire, kind)
        self.robot = RosRobot(self.end, PIONEER, TopicNames(), T_base_camera, patience=2.0, config=config)

    @property
    def commands(self) -> list[Velocity]:
        return [command_of(message) for message in self.wire.heard["/cmd_vel"]]

    def pass_time(self, seconds: float) -> None:
        """Let the wall's clock go on while the explorer computes."""
        self.end.wait(lambda: False, seconds)


@pytest.fixture
def pair() -> Pair:
    return Pair()


def test_a_navigator_drives_it(pair: Pair) -> None:
    assert Follower(pair.robot).drive(np.array([(1.8, 1.0), (1.8, 1.5)]), 0.5)
    np.testing.assert_allclose(pair.room.body.T[:2, 3], (1.8, 1.5), atol=0.06)
    assert pair.commands[-1] == Velocity()


def test_it_senses_what_the_robot_sent_and_where_that_was(pair: Pair) -> None:
    for command in [Velocity(0.2, 0.5)] * 7:
        pair.robot.drive(command)
    frame = pair.robot.sense()
    sent = pair.room.frames[frame.time]
    assert pair.robot.time - frame.time <= 0.1
    np.testing.assert_array_equal(frame.depth, sent.depth)
    np.testing.assert_array_equal(frame.rgb, sent.rgb)
    np.testing.assert_allclose(frame.T_odom_base, sent.T_odom_base, atol=1e-6)
    assert frame.intrinsics == sent.intrinsics
    assert pair.robot.sense().time > frame.time


def test_settings_say_how_far_the_camera_sees() -> None:
    robot = Pair(config=LiveConfig(depth_range=(1.0, 2.5), depth_noise=0.003)).robot
    depth = robot.sense().depth
    assert depth[depth > 0].min() >= 1.0 and 2.0 < depth.max() <= 2.5
    assert robot.sensor is not None and robot.sense().sensor.sigma(2.0) == pytest.approx(0.012)
    with pytest.raises(InputError, match=r"ros\.live\.depth_range 3 1: "):
        Pair(config=LiveConfig(depth_range=(3.0, 1.0)))


def test_motions_carry_what_is_felt(pair: Pair) -> None:
    for _ in range(5):
        motion = pair.robot.drive(Velocity(0.2, 0.4))
    assert motion.gyro == pytest.approx([0, 0, 0.4])
    assert motion.accelerometer == pytest.approx([0, 0, 9.81])
    assert np.diff(motion.wheel_speed) == pytest.approx(0.4 * PIONEER.width)
    assert pair.robot.control_period == pytest.approx(pair.room.body.control_period)


def test_without_inertial_sensors_the_odometry_says_whether_it_leans() -> None:
    wire, lean = Wire(), 0.2
    wire.change = silent("/imu")
    _, end = met_on(wire)
    robot = RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0)
    tilted = np.array([[np.cos(lean), 0, np.sin(lean)], [0, 1, 0], [-np.sin(lean), 0, np.cos(lean)]])

    def leaning(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
        T = from_rotation(tilted, np.zeros(3))
        odometry = messages.odometry(time, T, Velocity(0.1, 0.3))
        return [] if topic == "/imu" else [(topic, time, odometry if topic == ODOM else message)]

    wire.change = leaning
    motion = robot.drive(Velocity())
    assert motion.accelerometer == pytest.approx(tilted.T @ [0, 0, g])
    assert motion.gyro == pytest.approx([0, 0, 0.3])


def test_it_stands_while_what_drives_it_computes(pair: Pair) -> None:
    pair.robot.drive(Velocity(0.2))
    before = pair.room.body.T[0, 3]
    pair.pass_time(3.0)
    assert pair.commands[-1] == Velocity()
    assert pair.room.body.T[0, 3] - before < 0.2 * (0.2 + 0.15)


def test_stamped_commands_are_sent_to_what_listens_to_them() -> None:
    pair = Pair("geometry_msgs/msg/TwistStamped")
    pair.robot.drive(Velocity(0.2, 0.1))
    (message,) = pair.wire.heard["/cmd_vel"]
    assert message.twist.linear.x == 0.2
    assert message.header.frame_id == "base_link"


@pytest.mark.parametrize("topic", ["/tf_static", "/camera/transform"])
def test_a_transform_says_where_the_camera_is(topic: str) -> None:
    wire = Wire()
    room, end = met_on(wire)
    wire.change = silent("/tf_static")
    with pytest.raises(InputError, match=r"camera_optical.*--camera-pose"):
        RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    link = messages.transform(0.0, "base_link", "camera_optical", T_BASE_CAMERA)
    message = messages.make("tf2_msgs/TFMessage", [link]) if topic == "/tf_static" else link
    wire.change = unchanged
    room.end.publish(topic, 0.0, message)
    robot = RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    np.testing.assert_allclose(robot.sense().T_base_camera, T_BASE_CAMERA, atol=1e-9)


def transforms_on(moving: str, fixed: str) -> Change:
    """Transforms on other topics; those that do not move are sent again and again, for the wire keeps no others."""

    def change(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
        if topic == "/tf_static":
            return []
        mount = messages.transforms(time, {("base_link", "camera_optical"): T_BASE_CAMERA})
        return [(moving, time, message), (fixed, time, mount)] if topic == "/tf" else [(topic, time, message)]

    return change


def prefixed(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    """Frames of a robot with a name, whose odometry and camera_info do without."""
    for link in getattr(message, "transforms", ()):
        link.header.frame_id, link.child_frame_id = f"r1/{link.header.frame_id}", f"r1/{link.child_frame_id}"
    return [(topic, time, message)]


def on_footprint(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    if topic == ODOM:
        message.child_frame_id = "base_footprint"
    return [] if topic == "/tf" else [(topic, time, message)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (transforms_on("/j100_0001/tf", "/j100_0001/tf_static"), ""),
        (transforms_on("/tf", "/tf"), ""),
        (prefixed, "r1/base_link"),
        (on_footprint, "base_footprint"),
    ],
)
def test_transforms_are_found_under_other_names(change: Change, said: str, caplog: pytest.LogCaptureFixture) -> None:
    wire = Wire()
    wire.change = change
    _, end = met_on(wire)
    robot = RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    np.testing.assert_allclose(robot.sense().T_base_camera, T_BASE_CAMERA, atol=1e-9)
    assert said in caplog.text and bool(caplog.text) == bool(said)


def test_depth_of_another_camera_is_registered_to_colour(caplog: pytest.LogCaptureFixture) -> None:
    beside = from_rotation(np.eye(3), [0.05, 0, 0])

    def two_cameras(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
        if topic == "/camera/color/camera_info":
            message.header.frame_id = "color"
        if topic == "/tf_static":
            links = {("base_link", "camera_optical"): T_BASE_CAMERA, ("camera_optical", "color"): beside}
            message = messages.transforms(time, links)
        return [(topic, time, message)]

    wire = Wire()
    wire.change = two_cameras
    room, end = met_on(wire)
    robot = RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    frame = robot.sense()
    np.testing.assert_allclose(frame.T_base_camera, T_BASE_CAMERA @ beside, atol=1e-9)
    assert not np.array_equal(frame.depth, room.frames[frame.time].depth)
    assert "color" in caplog.text


def in_namespace(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    return [(f"/j100_0001{topic}", time, message)]


def test_topics_of_other_names_are_said() -> None:
    wire = Wire()
    wire.change = in_namespace
    _, end = met_on(wire)
    with pytest.raises(InputError, match=f"/j100_0001{INFO}, /j100_0001{DEPTH}, .*/j100_0001{ODOM}.*--topics"):
        RosRobot(end, PIONEER, TopicNames(), patience=2.0)


def test_inertial_sensors_of_another_name_are_said(caplog: pytest.LogCaptureFixture) -> None:
    wire = Wire()
    wire.change = lambda topic, time, message: [("/imu/data" if topic == "/imu" else topic, time, message)]
    _, end = met_on(wire)
    RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    assert "/imu/data" in caplog.text and "--topics.imu" in caplog.text


def test_a_type_that_is_not_installed_is_no_reason_to_give_up(monkeypatch: pytest.MonkeyPatch) -> None:
    subscribe = End.subscribe

    def refusing(end: End, topic: str, *args: Any) -> None:
        if topic == "/tf_static":
            raise InputError("/tf_static")
        subscribe(end, topic, *args)

    monkeypatch.setattr(End, "subscribe", refusing)
    assert Pair().robot.drive(Velocity()).time > 0


def silent(*topics: str) -> Change:
    return lambda topic, time, message: [] if topic in topics else [(topic, time, message)]


def other_clock(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    """Images whose stamps are the wall's."""
    if topic in (DEPTH, COLOUR):
        message = replace(message, header=messages.header(1.7e9 + time, message.header.frame_id))
    return [(topic, time, message)]


def smaller(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    """Depth images of another size."""
    if topic == DEPTH:
        message = messages.image(time, "32FC1", np.ones((10, 20), np.float32))
    return [(topic, time, message)]


def late(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    """Colour images whose stamps are too late to belong to depth images."""
    if topic == COLOUR:
        message = replace(message, header=messages.header(time + 0.1, message.header.frame_id))
    return [(topic, time, message)]


def still(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
    """Odometry whose clock has stopped."""
    return [(topic, time, messages.odometry(1.0, np.eye(4), Velocity()) if topic == ODOM else message)]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (silent(DEPTH), DEPTH),
        (silent(COLOUR), COLOUR),
        (silent(ODOM), ODOM),
        (other_clock, "timestamps differ.* 1700000"),
        (smaller, "20 × 10 .* 320 × 240"),
        (still, "timestamps differ.* 1.00 s"),
        (late, "stamps.* 0.02 s"),
    ],
)
def test_what_goes_wrong_while_it_drives_is_said_and_the_robot_stopped(
    pair: Pair, change: Change, fault: str
) -> None:
    pair.robot.drive(Velocity(0.2))
    pair.robot.sense()
    pair.wire.change = change
    with pytest.raises(InputError, match=fault):
        for _ in range(50):
            pair.robot.drive(Velocity(0.2))
            pair.robot.sense()
    pair.pass_time(1.0)
    assert pair.commands[-1] == Velocity()


def test_a_message_that_cannot_be_read_stops_the_robot(pair: Pair) -> None:
    pair.robot.drive(Velocity(0.2))

    def unreadable() -> None:
        raise InputError(f"{ODOM}: ")

    pair.end.work = unreadable
    with pytest.raises(InputError, match=ODOM):
        pair.robot.drive(Velocity(0.2))
    assert pair.commands[-1] == Velocity()


def test_a_robot_that_ignores_commands_is_given_up(pair: Pair) -> None:
    pair.wire.takers["/cmd_vel"] = [("robot", lambda data: None)]
    with pytest.raises(InputError, match="/cmd_vel: "):
        for _ in range(500):
            pair.robot.drive(Velocity(0.2))
    assert pair.commands[-1] == Velocity()


def test_a_robot_that_turns_in_place_or_is_to_stand_does_not_ignore_commands(pair: Pair) -> None:
    for command in [Velocity(0.0, 0.3)] * 120 + [Velocity()] * 120:
        pair.robot.drive(command)


@pytest.mark.parametrize("topic", [DEPTH, COLOUR, INFO, ODOM])
def test_what_is_not_there_is_named(topic: str) -> None:
    wire = Wire()
    wire.change = silent(topic)
    _, end = met_on(wire)
    with pytest.raises(InputError, match=rf"s: .*{topic}(;|$)"):
        RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0)


def test_a_robot_that_starts_later_is_waited_for(caplog: pytest.LogCaptureFixture) -> None:
    wire = Wire()
    start = wire.time + 4
    wire.change = lambda topic, time, message: [(topic, time, message)] if wire.time > start else []
    _, end = met_on(wire)
    with pytest.raises(InputError, match=r"3 s: .*/odom"):
        RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0, wait=1.0)
    assert "/odom" in caplog.text
    assert RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0, wait=9.0).time > 0


def test_two_robots_or_none_that_listens_are_refused() -> None:
    wire = Wire()
    _, end = met_on(wire)
    wire.publishers[ODOM] = ["another"]
    with pytest.raises(InputError, match=r"/odom: .*another, robot"):
        RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0)
    with pytest.raises(InputError, match="/drive"):
        RosRobot(end, PIONEER, TopicNames(cmd_vel="/drive"), T_BASE_CAMERA, patience=2.0)


def clouds(wrong: str) -> Change:
    """Point clouds on a topic of something else."""

    def change(topic: str, time: float, message: Any) -> list[tuple[str, float, Any]]:
        cloud = messages.cloud(time, "lens", {"x": np.zeros(1, np.float32)})
        return [(topic, time, cloud if topic == wrong else message)]

    return change


@pytest.mark.parametrize(
    ("topic", "kind"),
    [(DEPTH, "Image"), (COLOUR, "Image"), (INFO, "CameraInfo"), (ODOM, "Odometry"), ("/imu", "Imu")],
)
def test_a_topic_of_another_type_is_refused(topic: str, kind: str) -> None:
    wire = Wire()
    wire.change = clouds(topic)
    _, end = met_on(wire)
    with pytest.raises(InputError, match=f"{topic}: .*{kind}.*PointCloud2.*--topics"):
        RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0)


def test_a_listener_to_commands_of_another_type_is_refused() -> None:
    with pytest.raises(InputError, match=r"/cmd_vel: .*Twist.*std_msgs/msg/String"):
        Pair("std_msgs/msg/String")


def test_another_use_of_the_name_of_the_camera_transform_is_ignored() -> None:
    wire = Wire()
    _, end = met_on(wire)
    end.publish("/camera/transform", 0.0, messages.velocity(Velocity()))
    assert RosRobot(end, PIONEER, TopicNames(), T_BASE_CAMERA, patience=2.0).drive(Velocity()).time > 0


class Held:
    """A lock that knows whether it is held."""

    count = 0

    def __enter__(self) -> None:
        self.count += 1

    def __exit__(self, *error: object) -> None:
        self.count -= 1


def test_transforms_are_read_while_no_message_is_handled(monkeypatch: pytest.MonkeyPatch) -> None:
    wire, lock = Wire(), Held()
    _, end = met_on(wire)
    end.received = lock  # type: ignore[assignment]
    seen: list[bool] = []
    for name in ("mount", "has_parent", "between"):
        read = getattr(FrameTree, name)
        monkeypatch.setattr(FrameTree, name, lambda *args, read=read: (seen.append(lock.count > 0), read(*args))[1])
    wait = End.wait

    def waiting(end: End, until: Any, seconds: float) -> bool:
        def held() -> bool:
            with lock:
                return until()

        return wait(end, held, seconds)

    monkeypatch.setattr(End, "wait", waiting)
    robot = RosRobot(end, PIONEER, TopicNames(), patience=2.0)
    robot.drive(Velocity())
    assert not robot.has_map
    assert seen and all(seen)
