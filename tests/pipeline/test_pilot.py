"""How a robot takes keyframes on the way, and what it does if the map disagrees with its frames."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config import PipelineConfig
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.belief import MotionState
from pipeline.localisation.config import KeyframePolicy, LocalisationConfig, PoseCheckConfig
from pipeline.localisation.localisation import LostError
from pipeline.localisation.pose_check import ConfirmedPose
from pipeline.localisation.pose_graph import ConstraintKind
from pipeline.mapper import Keyframe, Mapper, sense_and_map
from pipeline.navigation.commands import Outcome
from pipeline.navigation.config import NavigationConfig
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import Halt
from pipeline.navigation.obstacle_check import ObstacleCheck
from pipeline.pilot import Pilot
from pipeline.planning.stretches import stretches_of
from pipeline.robot import Motion, Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.sensor import XTION
from pipeline.sink import Sink
from pipeline.transforms import from_yaw, inverse
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.carried_robot import BARE, ROOM, seen
from tests.pipeline.polygon_scene import floor, wall
from tests.pipeline.robot_model import PIONEER

LOOKS = 5
RARE = 9.0  # Spacing of keyframes, m, with which a drive has only those of its checks for obstacles
START = from_yaw(2.0, 2.0, 0.0, 0.0)
CLOSET = [floor(0.8, 3.3, 0.9, 3.2)]
CLOSET += [wall(a, b) for a, b in (((0.8, 0.9), (3.3, 0.9)), ((3.3, 0.9), (3.3, 3.2)), ((3.3, 3.2), (0.8, 3.2)))]
PANEL = wall((3.2, 1.2), (3.2, 2.8))


class SeeingRobot(KinematicRobot):
    """A robot that sees a scene of faces, with perfect odometry."""

    def __init__(self):
        super().__init__()
        self.T = START
        self.faces = BARE
        self.looks = 0

    def sense(self) -> Frame:
        self.looks += 1
        return replace(seen(self.faces, self.T, seed=self.looks), time=float(self.looks))


class Album(Sink):
    """Keeps the keyframes."""

    def __init__(self):
        self.keyframes: list[Keyframe] = []

    def on_keyframe(self, keyframe):
        self.keyframes.append(keyframe)


class Outlook:
    """A robot that looks around from where it stands; every fourth of its keyframes is labelled."""

    def __init__(self, robot=None, spacing=0.4):
        self.robot, album = robot or SeeingRobot(), Album()
        policy = KeyframePolicy(distance=spacing, turn=np.deg2rad(20), labelled_every=4)
        config = PipelineConfig(
            LocalisationConfig(keyframes=policy, pose_check=PoseCheckConfig(views_per_turn=LOOKS))
        )
        self.mapper = Mapper(PIONEER, TruthClassifier(), config=config)
        self.mapper.observers.append(album)
        self.keyframes = album.keyframes
        self.pilot = Pilot(self.robot, self.mapper, [])

    def look_around(self, place: np.ndarray) -> "Outlook":
        """Make keyframes of a full turn."""
        for yaw in np.arange(6) * np.pi / 3:
            self.robot.T = place @ from_yaw(0, 0, 0, yaw)
            sense_and_map(self.mapper, self.pilot.sense, self.pilot.confirm, labelled=False, may_repeat=True)
        self.robot.T = place
        return self

    def confirm(self) -> ConfirmedPose:
        """Look around without making a keyframe."""
        return self.pilot.confirm(self.mapper.localise(self.pilot.sense()))

    def drive(self, x: float, y: float, nearest: float = XTION.nearest, is_done=lambda: False) -> Outcome:
        """Drive straight to a place, and look for obstacles farther than ``nearest``, m."""
        sensor = replace(XTION, nearest=nearest)
        self.check = ObstacleCheck(self.mapper.traversability, sensor, NavigationConfig().obstacle_check)
        start = self.pilot.navigator.stopping_pose(self.keyframes[-1].T_map_base)
        way = stretches_of(np.array([(x, y)]), np.zeros(1, np.bool_), start, None, lambda poses: False)
        return self.pilot.follow(self.check, Course(way), is_done)


@pytest.fixture(scope="module")
def looked_around():
    return Outlook().look_around(START)


@pytest.fixture
def outlook(looked_around, monkeypatch):
    """The shared outlook, restored after each test; a test must add no keyframe."""
    slam = looked_around.mapper.localisation
    for part in (
        looked_around.robot,
        looked_around.pilot,
        looked_around.pilot.pose_check,
        looked_around.pilot.navigator,
        slam,
        slam.belief,
    ):
        for name, value in vars(part).items():
            monkeypatch.setattr(part, name, value)
    return looked_around


def test_what_agrees_with_the_map_needs_one_look(outlook):
    before = outlook.robot.looks
    confirmed = outlook.confirm()
    assert outlook.robot.looks == before + 1
    assert not confirmed.was_carried


@pytest.mark.parametrize(("x", "is_blind"), [(1.2, True), (2.3, False)])
def test_blank_depth_counts_only_where_the_map_has_something_to_be_seen(x, is_blind, outlook):
    """The robot drives 1.2 m to and fro, towards a mapped wall or out of ground that is too near to be measured."""
    outlook.pilot.pose_check.check_depth(outlook.mapper.localise(frame := seen(BARE, START)))
    blank = replace(frame, depth=np.zeros_like(frame.depth))
    noticed = False
    for step in range(5):
        T = from_yaw(x + 0.3 * (step % 2), 2.0, 0, np.pi)
        try:
            outlook.pilot.pose_check.check_depth(
                outlook.mapper.localise(replace(blank, T_odom_base=T, time=step + 1.0))
            )
        except LostError as error:
            noticed = "no depth" in str(error)
    assert noticed == is_blind


def test_an_object_that_was_put_in_the_way_is_no_reason_to_be_lost(outlook):
    outlook.robot.faces = [*BARE, PANEL]
    before = outlook.robot.looks
    confirmed = outlook.confirm()
    assert outlook.robot.looks > before + 1
    assert outlook.pilot.pose_check.relocalised == 0
    assert not confirmed.was_carried


def test_nor_is_it_where_no_place_is_found_for_sure():
    """The robot stands in the middle of a room that looks the same turned by half a turn."""
    middle = from_yaw(2.5, 2.0, 0, 0)
    outlook = Outlook().look_around(middle)
    outlook.robot.faces = [*BARE, wall((3.7, 1.2), (3.7, 2.8))]
    before = outlook.robot.looks
    confirmed = outlook.confirm()
    assert before + 1 < outlook.robot.looks <= before + 1 + LOOKS
    assert outlook.pilot.pose_check.relocalised == 0
    assert not confirmed.was_carried


def test_a_robot_that_leaned_looks_again_and_believes_what_it_sees(outlook):
    outlook.confirm()
    belief = outlook.mapper.belief
    belief.predict(0.3, 1.0)
    outlook.pilot.pose_check.doubt()
    assert not belief.knows_place
    looks = outlook.robot.looks
    outlook.confirm()  # all that it sees agrees with its map, so its map is wrong where it leaned
    assert belief.knows_place
    assert outlook.robot.looks == looks + 1


def test_a_robot_in_another_room_is_lost(outlook):
    outlook.robot.faces = CLOSET
    with pytest.raises(LostError, match="no other place"):
        outlook.confirm()


class Screened(SeeingRobot):
    """A robot that sees another room until it is 0.4 m behind its start."""

    def sense(self) -> Frame:
        self.faces = CLOSET if self.T[0, 3] > START[0, 3] - 0.4 else ROOM
        return super().sense()


@pytest.mark.parametrize(("was_halted", "is_found"), [(True, True), (False, False)])
def test_a_robot_that_is_lost_after_a_halt_looks_again_from_where_it_came(was_halted, is_found):
    outlook = Outlook()
    outlook.robot.faces = ROOM
    outlook.look_around(START)
    robot = Screened()
    robot.T, robot.looks = START, outlook.robot.looks
    outlook.pilot.robot = outlook.robot = robot
    if was_halted:
        outlook.pilot.navigator.halts.append(Halt(START, Velocity(0.2), has_backed_out=True))
    if is_found:
        outlook.confirm()
        assert outlook.mapper.belief.knows_place
        assert robot.T[0, 3] == pytest.approx(START[0, 3] - 0.6, abs=0.1)
    else:
        with pytest.raises(LostError):
            outlook.confirm()
        assert robot.T[0, 3] == START[0, 3]


def test_a_robot_that_drove_back_by_itself_was_not_carried(outlook, monkeypatch):
    outlook.confirm()
    monkeypatch.setattr(outlook.pilot.navigator, "halts", [Halt(START, Velocity(0.2), has_backed_out=True)])
    in_doubt = [True, True, False]  # Until the robot has driven back twice

    def confirm(localised, last, turn):
        turn(0.2)
        if in_doubt.pop(0):
            raise LostError
        return ConfirmedPose(localised, None)

    monkeypatch.setattr(outlook.pilot.pose_check, "confirm", confirm)
    assert not outlook.confirm().was_carried
    assert outlook.robot.T[0, 3] == pytest.approx(START[0, 3] - 0.6, abs=0.1)


def test_a_robot_whose_wheels_spun_while_it_backed_out_drives_back_again(outlook, monkeypatch):
    outlook.confirm()
    monkeypatch.setattr(
        outlook.pilot.navigator, "halts", [Halt(START, Velocity(0.2), has_backed_out=True, backed_distance=0.3)]
    )
    is_held = [True, False]

    def confirm(localised, last, turn):
        turn(0.1)
        return ConfirmedPose(localised, None)

    monkeypatch.setattr(outlook.pilot.pose_check, "confirm", confirm)
    monkeypatch.setattr(outlook.pilot.navigator, "is_still_held", lambda T_map_odom: is_held.pop(0))
    assert not outlook.confirm().was_carried
    assert outlook.robot.T[0, 3] == pytest.approx(START[0, 3] - 0.3, abs=0.05)


@pytest.mark.parametrize("faces", [CLOSET, [wall((2.6, 1.0), (2.6, 3.0))]])
def test_the_pose_of_a_lost_robot_is_not_trusted_where_a_small_map_does_not_contradict_it(faces):
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    outlook.mapper.keyframes.loaded_count, outlook.robot.faces = 1, faces
    outlook.robot.T = START @ from_yaw(0, 0, 0, np.pi)
    with pytest.raises(LostError, match="no other place"):
        outlook.pilot.take_keyframe()


@pytest.mark.parametrize(("way", "was_carried"), [(0.2, False), (0.5, True)])
def test_where_the_odometry_leaps_the_robot_was_set_down(way, was_carried):
    outlook = Outlook()
    assert outlook.confirm().was_carried  # it has just begun
    outlook.robot.T = START @ from_yaw(way, 0, 0, 0)
    assert outlook.confirm().was_carried == was_carried


class FastRobot(SeeingRobot):
    """A robot that needs 1 m to stop."""

    model = replace(PIONEER, speed=0.7)


@pytest.fixture
def rolling() -> Outlook:
    """A robot that is rolling."""
    outlook = Outlook(FastRobot())
    outlook.pilot.take_keyframe()
    assert outlook.drive(4.0, 2.0, nearest=9.0, is_done=lambda: True) is Outcome.REACHED
    outlook.pilot.take_keyframe()
    return outlook


def test_a_robot_that_rolled_to_a_stop_was_not_carried(rolling):
    before = rolling.robot.T[0, 3]
    rolling.pilot.halt()
    assert rolling.robot.T[0, 3] > before + 0.5
    assert not rolling.confirm().was_carried


def test_nor_was_one_that_rolled_to_a_stop_to_look_around(rolling, monkeypatch):
    def confirm(localised, last, turn):
        return ConfirmedPose(turn(0.2), None)

    monkeypatch.setattr(rolling.pilot.pose_check, "confirm", confirm)
    before = rolling.robot.T[0, 3]
    assert not rolling.confirm().was_carried
    assert rolling.robot.T[0, 3] > before + 0.5


def test_keyframes_are_taken_on_the_way_and_every_so_many_one_is_labelled():
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    assert outlook.drive(4.0, 2.0, nearest=9.0) is Outcome.REACHED
    places = [keyframe.T_map_base[0, 3] for keyframe in outlook.keyframes]
    np.testing.assert_allclose(places, 2.0 + 0.4 * np.arange(5), atol=0.05)
    assert [len(keyframe.labels) > 0 for keyframe in outlook.keyframes] == [True, False, False, False, True]


def test_the_interval_of_labels_counts_from_the_last_one_and_includes_checks_for_obstacles():
    outlook = Outlook(spacing=RARE)
    for _ in range(2):
        outlook.pilot.take_keyframe()
    assert outlook.drive(4.0, 2.0, nearest=0.3) is Outcome.REACHED
    labelled = [len(keyframe.labels) > 0 for keyframe in outlook.keyframes]
    assert labelled == [True, True, False, False, False, True, False]


def test_the_check_for_obstacles_makes_a_keyframe():
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    outlook.robot.faces = [*BARE, wall((3.2, 1.8), (3.2, 2.2), z1=0.4)]
    assert outlook.drive(4.0, 2.0) is Outcome.BLOCKED
    assert len(outlook.keyframes) == 2


def test_a_frame_that_an_obstacle_puts_in_doubt_becomes_no_keyframe_nor_is_the_obstacle_kept():
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    outlook.robot.faces = [*BARE, PANEL]
    assert outlook.drive(4.0, 2.0) is Outcome.BLOCKED
    assert len(outlook.keyframes) == 1
    assert len(outlook.check.obstacles) == 0


def test_after_a_check_for_obstacles_the_robot_may_have_seen_what_it_wants():
    outlook = Outlook(spacing=RARE)
    outlook.pilot.take_keyframe()
    assert outlook.drive(4.0, 2.0, is_done=lambda: len(outlook.keyframes) == 3) is Outcome.REACHED
    assert len(outlook.keyframes) == 3
    assert outlook.robot.T[0, 3] < 3.0


def test_it_stops_for_an_obstacle_also_when_it_has_seen_what_it_wants():
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    outlook.robot.faces = [*BARE, PANEL]
    assert outlook.drive(4.0, 2.0, is_done=lambda: True) is Outcome.BLOCKED


def test_it_stops_for_a_person_whom_it_saw_in_a_check_for_obstacles(monkeypatch):
    outlook = Outlook(spacing=RARE)
    outlook.pilot.take_keyframe()
    hand = np.array([(3.5, 2.0, 0.05)], np.float32)
    monkeypatch.setattr(Mapper, "people", property(lambda mapper: [hand] if len(mapper.keyframes) == 3 else []))
    assert outlook.drive(4.0, 2.0) is Outcome.BLOCKED
    assert len(outlook.keyframes) == 3


def test_a_check_for_obstacles_also_notices_that_the_robot_is_elsewhere():
    outlook = Outlook(spacing=RARE)
    outlook.pilot.take_keyframe()
    outlook.robot.faces = CLOSET
    assert outlook.drive(2.7, 2.0) is Outcome.UNSURE
    assert len(outlook.keyframes) == 1


def test_a_check_for_obstacles_also_notices_that_the_robot_is_held(monkeypatch):
    outlook = Outlook(spacing=RARE)
    outlook.pilot.take_keyframe()
    monkeypatch.setattr(outlook.mapper.belief, "is_sure_of", lambda state: state is MotionState.HELD)
    assert outlook.drive(4.0, 2.0) is Outcome.STUCK


class HeldRobot(SeeingRobot):
    """A robot that something holds at x = 2.5 m, where its wheels spin: its odometry goes on."""

    def sense(self) -> Frame:
        T = self.T.copy()
        T[0, 3] = min(T[0, 3], 2.5)
        self.looks += 1
        return replace(seen(ROOM, T, T @ inverse(self.T), seed=self.looks), time=float(self.looks))


@pytest.mark.parametrize(("robot", "outcome"), [(HeldRobot(), Outcome.STUCK), (SeeingRobot(), Outcome.REACHED)])
def test_a_robot_whose_wheels_spin_is_held(robot, outcome):
    outlook = Outlook(robot)
    outlook.pilot.take_keyframe()
    assert outlook.drive(4.0, 2.0) is outcome
    noticed = ["held"] if outcome is Outcome.STUCK else []
    assert [fault.kind for fault in outlook.pilot.faults.all if fault.kind != "slipping"] == noticed
    if outcome is Outcome.STUCK:
        assert robot.T[0, 3] < 2.5 + 3 * 0.4 + 0.1  # It brakes after the third keyframe
        (halt,) = outlook.pilot.navigator.halts
        assert halt.T_map_base[0, 3] == pytest.approx(2.5, abs=0.1)


def test_invalid_input_from_the_camera_is_reported_as_such_at_every_attempt():
    outlook, errors = Outlook(), [OSError("timeout"), InputError("the image is too large")]

    def sense():
        raise errors.pop(0)

    outlook.robot.sense = sense
    with pytest.raises(InputError, match="too large"):
        outlook.pilot.sense()


@pytest.mark.parametrize("place", [np.nan, 1e6])
def test_without_odometry_the_robot_stands(place):
    class Astray(SeeingRobot):
        def drive(self, command: Velocity) -> Motion:
            motion = super().drive(command)
            return replace(motion, T_odom_base=from_yaw(place, 0, 0, 0)) if len(self.commands) > 20 else motion

    outlook = Outlook(Astray())
    outlook.pilot.take_keyframe()
    with pytest.raises(LostError, match="odometry"):
        outlook.drive(4.0, 2.0)
    assert outlook.robot.commands[-2].v > 0
    assert outlook.robot.commands[-1] == Velocity()


def test_a_registration_that_is_no_number_is_left_out_and_noted():
    outlook = Outlook()
    outlook.pilot.take_keyframe()
    graph = outlook.mapper.localisation.graph
    before = graph.poses.copy()
    graph.connect(0, 0, np.full((4, 4), np.nan), np.eye(6), ConstraintKind.SURFACE)
    outlook.pilot.correct()
    assert [fault.kind for fault in outlook.pilot.faults.all] == ["registration"]
    np.testing.assert_array_equal(graph.poses, before)
