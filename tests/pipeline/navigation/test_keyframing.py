"""How a robot with a camera takes keyframes during a drive, and what it does if the map disagrees with its frames."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.frame import Frame
from pipeline.localisation.localisation import KEYFRAME_WAY, LostError
from pipeline.localisation.slam import Slam
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.keyframing import LABELLED, Keyframing
from pipeline.navigation.navigator import Halt, Navigator, Outcome
from pipeline.navigation.pose_check import LOOKS
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw, inverse
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.carried_robot import BARE, ROOM, seen
from tests.pipeline.polygon_scene import floor, wall
from tests.pipeline.robot_model import PIONEER

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


class Outlook:
    """A robot that looks around from where it stands, with its navigator, mapper and keyframing."""

    def __init__(self):
        self.robot = SeeingRobot()
        self.navigator = Navigator(self.robot)
        self.mapper = Mapper(PIONEER, TruthClassifier(), localisation=Slam())
        self.keyframes: list[Keyframe] = []
        self.keyframing = Keyframing(self.navigator, self.mapper, self.keyframes.append)

    def look_around(self, place: np.ndarray) -> "Outlook":
        """Make keyframes of a full turn."""
        for yaw in np.arange(6) * np.pi / 3:
            self.robot.T = place @ from_yaw(0, 0, 0, yaw)
            frame = self.keyframing.sense()
            self.keyframing.pose_check.was_set_down(frame)
            self.keyframing.add(frame, labelled=False)
        self.robot.T = place
        return self


@pytest.fixture(scope="module")
def looked_around():
    return Outlook().look_around(START)


@pytest.fixture
def outlook(looked_around, monkeypatch):
    """The shared outlook, restored after each test; a test must add no keyframe."""
    slam = looked_around.mapper.localisation
    for thing in (
        looked_around.robot,
        looked_around.keyframing,
        looked_around.keyframing.pose_check,
        looked_around.navigator,
        slam,
        slam.belief,
    ):
        for name, value in vars(thing).items():
            monkeypatch.setattr(thing, name, value)
    return looked_around


def test_what_agrees_with_the_map_needs_one_look(outlook):
    before = outlook.robot.looks
    frame = outlook.keyframing.sense()
    assert outlook.robot.looks == before + 1
    assert not outlook.keyframing.pose_check.was_set_down(frame)


@pytest.mark.parametrize(("x", "is_blind"), [(1.2, True), (2.3, False)])
def test_blank_depth_counts_only_where_the_map_has_something_to_be_seen(x, is_blind, monkeypatch):
    """The robot drives 1.2 m to and fro, towards a mapped wall or out of ground that is too near to be measured."""
    outlook = Outlook().look_around(START)
    robot, keyframing = outlook.robot, outlook.keyframing
    blank = replace(seen(BARE, START, seed=1), depth=np.zeros_like(seen(BARE, START, seed=1).depth))
    monkeypatch.setattr(robot, "sense", lambda: replace(blank, T_odom_base=robot.T))
    noticed = False
    for step in range(5):
        robot.T = from_yaw(x + 0.3 * (step % 2), 2.0, 0, np.pi)
        try:
            keyframing.returns()
        except LostError as error:
            noticed = "no depth" in str(error)
    assert noticed == is_blind


def test_a_thing_that_was_put_in_the_way_is_no_reason_to_be_lost(outlook):
    outlook.robot.faces = [*BARE, PANEL]
    before = outlook.robot.looks
    frame = outlook.keyframing.sense()
    assert outlook.robot.looks > before + 1
    assert outlook.keyframing.pose_check.relocalised == 0
    assert not outlook.keyframing.pose_check.was_set_down(frame)


def test_nor_is_it_where_no_place_is_found_for_sure():
    """The robot stands in the middle of a room that looks the same turned by half a turn."""
    middle = from_yaw(2.5, 2.0, 0, 0)
    outlook = Outlook().look_around(middle)
    outlook.robot.faces = [*BARE, wall((3.7, 1.2), (3.7, 2.8))]
    before = outlook.robot.looks
    frame = outlook.keyframing.sense()
    assert before + 1 < outlook.robot.looks <= before + 1 + LOOKS
    assert outlook.keyframing.pose_check.relocalised == 0
    assert not outlook.keyframing.pose_check.was_set_down(frame)


@pytest.mark.parametrize("is_ramp", [True, False])
def test_a_robot_that_leans_where_its_map_is_level_doubts_its_place(outlook, is_ramp):
    outlook.keyframing.sense()
    belief, halt = outlook.mapper.localisation.belief, Halt(START, Velocity(0.2), True)
    belief.predict(0.3, 1.0)
    ground = SimpleNamespace(has_ramp=lambda place: is_ramp)
    outlook.keyframing.pose_check.doubt(halt, ground)
    assert belief.knows_place == is_ramp
    looks = outlook.robot.looks
    outlook.keyframing.sense()  # all that it sees agrees with its map, so its map is wrong there
    assert belief.knows_place
    assert outlook.robot.looks == looks + 1


def test_a_robot_in_another_room_is_lost(outlook):
    outlook.robot.faces = CLOSET
    with pytest.raises(LostError, match="no place fits"):
        outlook.keyframing.sense()


@pytest.mark.parametrize("faces", [CLOSET, [wall((2.6, 1.0), (2.6, 3.0))]])
def test_the_pose_of_a_lost_robot_is_not_trusted_where_a_small_map_does_not_contradict_it(faces):
    outlook = Outlook()
    frame = outlook.keyframing.sense()
    outlook.keyframing.pose_check.was_set_down(frame)
    outlook.keyframing.add(frame, labelled=False)
    outlook.mapper.keyframes.loaded, outlook.robot.faces = 1, faces
    outlook.robot.T = START @ from_yaw(0, 0, 0, np.pi)
    with pytest.raises(LostError, match="no place fits"):
        outlook.keyframing.sense()


def test_where_the_odometry_leaps_the_robot_was_set_down(outlook):
    outlook.keyframing.pose_check.was_set_down(seen(BARE, START))
    near, far = (seen(BARE, START @ from_yaw(way * KEYFRAME_WAY, 0, 0, 0)) for way in (0.9, 2.0))
    assert not outlook.keyframing.pose_check.was_set_down(near)
    assert outlook.keyframing.pose_check.was_set_down(far)


def test_keyframes_are_taken_on_the_way_and_every_so_many_one_is_labelled():
    outlook = Outlook()
    outlook.keyframing.add(outlook.keyframing.sense(), labelled=True)
    assert outlook.navigator.follow(np.array([(3.0, 2.0)]), look=outlook.keyframing.look)
    places = [keyframe.T_map_base[0, 3] for keyframe in outlook.keyframes]
    np.testing.assert_allclose(places, 2.0 + KEYFRAME_WAY * np.arange(4), atol=0.05)
    assert [len(keyframe.labels) > 0 for keyframe in outlook.keyframes] == [k % LABELLED == 0 for k in range(4)]


def test_the_returns_are_those_of_a_keyframe_that_is_not_labelled():
    outlook = Outlook()
    points = outlook.keyframing.returns()
    (keyframe,) = outlook.keyframes
    assert len(points) == keyframe.frame.returns.sum()
    assert not len(keyframe.labels)
    assert abs(np.median(points[:, 2])) < 1.0
    assert points[:, 0].max() == pytest.approx(5.0, abs=0.1)


class HeldRobot(SeeingRobot):
    """A robot that something holds at x = 2.5 m, where its wheels spin: its odometry goes on."""

    def sense(self) -> Frame:
        T = self.T.copy()
        T[0, 3] = min(T[0, 3], 2.5)
        self.looks += 1
        return replace(seen(ROOM, T, T @ inverse(self.T), seed=self.looks), time=float(self.looks))


@pytest.mark.parametrize(("robot", "outcome"), [(HeldRobot(), Outcome.STUCK), (SeeingRobot(), Outcome.REACHED)])
def test_a_robot_whose_wheels_spin_is_held(robot, outcome):
    navigator, mapper = Navigator(robot), Mapper(PIONEER, TruthClassifier(), localisation=Slam())
    keyframing = Keyframing(navigator, mapper)
    keyframing.add(keyframing.sense(), labelled=True)
    navigator.follow(np.array([(4.0, 2.0)]), look=keyframing.look)
    assert [leg.outcome for leg in navigator.legs] == [outcome]
    noticed = ["slipping", "held"] if outcome is Outcome.STUCK else []
    assert [fault.kind for fault in keyframing.faults.all] == noticed
    if outcome is Outcome.STUCK:
        assert robot.T[0, 3] < 2.5 + 3 * KEYFRAME_WAY
        (halt,) = navigator.halts
        assert halt.T_map_base[0, 3] == pytest.approx(2.5, abs=0.1)
