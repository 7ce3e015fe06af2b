"""A short drive through a room with an odometry that drifts."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.frame import Frame
from pipeline.localisation.belief import MotionState
from pipeline.localisation.config import KeyframePolicy, LocalisationConfig, OdometryConfig, RegistrationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.localisation.localisation import LostError
from pipeline.localisation.motion_states import log_likelihoods
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.registration import logarithm
from pipeline.localisation.slam import Slam, certainty
from pipeline.transforms import from_rotation, from_yaw, inverse, transform_points
from tests.pipeline.localisation.driving_robot import ROOM, drifting, drive, seen
from tests.pipeline.polygon_scene import Face, floor, wall

TURN = [(0.0, np.pi / 12)] * 6
AROUND = drive(*[(0.3, 0.0)] * 8, *TURN, *[(0.3, 0.0)] * 6, *TURN, *[(0.3, 0.0)] * 8, *TURN, *[(0.3, 0.0)] * 6, *TURN)
"""Around the partition in the middle of the room and back to where it began: 8.4 m."""


@cache
def frames() -> list[Frame]:
    """Frames of that drive, with an odometry that measures 2% too long and turns by 0.06° from frame to frame."""
    odometry = drifting(AROUND, stretch=1.02, veer=np.deg2rad(0.06))
    return [seen(*poses, time=k) for k, poses in enumerate(zip(AROUND, odometry, strict=True))]


def driven(number: int, slam: Slam | None = None) -> Slam:
    """A robot that has made keyframes of the first frames of the drive."""
    slam = slam or Slam()
    for frame in frames()[:number]:
        slam.add(slam.localise(frame))
        slam.optimise()
    return slam


@cache
def whole() -> Slam:
    """The robot after the whole drive; tests must not change it."""
    return driven(len(AROUND))


def distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def test_it_stays_near_the_truth_where_the_odometry_does_not() -> None:
    slam, odometry = whole(), OdometryLocalisation()
    alone = [odometry.localise(frame).T_map_base for frame in frames()]
    errors = [distance(a, b) for a, b in zip(slam.poses, AROUND, strict=True)]
    assert max(errors) < 0.02
    assert max(np.linalg.norm(logarithm(inverse(a) @ b)[:3]) for a, b in zip(slam.poses, AROUND, strict=True)) < 0.02
    assert distance(alone[-1], AROUND[-1]) > 0.08
    assert slam.slips == 0


def test_the_first_keyframe_stays_where_the_odometry_began() -> None:
    np.testing.assert_allclose(whole().poses[0], AROUND[0], atol=1e-3)


def test_the_odometrys_origin_follows_what_was_found() -> None:
    slam = whole()
    np.testing.assert_allclose(slam.T_map_odom @ frames()[-1].T_odom_base, slam.poses[-1], atol=1e-9)


def test_it_keeps_each_surface_once_and_where_it_is() -> None:
    points = whole().points()
    x, y, z = points.T
    room = [np.abs(x), np.abs(x - 5), np.abs(y), np.abs(y - 4), np.abs(z), np.abs(x - 2.5)]
    assert np.mean(np.min(room, axis=0) < 0.03) > 0.99
    assert len(points) < 2 * 30 / 0.05**2  # 30 m² of surfaces, each from both sides at most


def test_a_pose_states_how_uncertain_it_is() -> None:
    deviation = np.sqrt(np.diag(whole().covariance))
    assert (deviation > 0).all()
    assert deviation.max() < 0.02


def test_a_frame_that_repeats_a_keyframe_is_passed_by_and_the_odometry_goes_on_from_it() -> None:
    """The robot comes back to where it began, and drives on blindly by 1 cm."""
    slam, (first, *_) = driven(3), frames()
    off = slam.T_map_odom
    again = replace(first, time=100.0, T_odom_base=inverse(off) @ slam.poses[0])
    match = slam.localise(again)
    assert match.repeats
    keyframes = len(slam.poses)
    slam.continue_without_keyframe(match)
    assert len(slam.poses) == keyframes
    ahead = replace(again, time=101.0, T_odom_base=again.T_odom_base @ from_yaw(0.01, 0, 0, 0), depth=0 * again.depth)
    on = slam.localise(ahead)
    assert distance(on.T_map_base, match.T_map_base @ from_yaw(0.01, 0, 0, 0)) < 0.001
    slam.add(on)
    slam.optimise()
    assert distance(slam.poses[-1], slam.poses[0] @ from_yaw(0.01, 0, 0, 0)) < 0.005


@pytest.mark.parametrize(
    ("way", "tilt", "on_ramps", "repeats"),
    [(0.3, 0, 0.5, True), (0.15, 0, 0.5, False), (0.3, -15, 0.5, False), (0.3, -15, 1.0, True)],
)
def test_a_frame_from_which_a_new_keyframe_is_due_repeats_none(
    way: float, tilt: float, on_ramps: float, repeats: bool
) -> None:
    """Halfway between two keyframes, the robot sees nothing that neither of them saw."""
    slam = Slam(config=LocalisationConfig(keyframes=KeyframePolicy(distance=way, on_ramps=on_ramps)))
    leaning = from_rotation(Rotation.from_euler("y", tilt, degrees=True).as_matrix(), np.zeros(3))
    for k, x in enumerate((0.0, 0.4, 0.2)):
        T = AROUND[0] @ from_yaw(x, 0.0, 0.0, 0.0) @ leaning
        match = slam.localise(seen(T, T, time=k))
        if k < 2:
            slam.add(match)
    assert match.repeats == repeats


def test_a_new_view_repeats_nothing() -> None:
    slam = Slam()
    for frame in frames()[:10:3]:
        match = slam.localise(frame)
        assert not match.repeats
        slam.add(match)


def test_the_same_frames_give_the_same_poses_to_the_last_bit() -> None:
    a, b = driven(6), driven(6)
    assert a.poses.tobytes() == b.poses.tobytes()
    assert a.T_map_odom.tobytes() == b.T_map_odom.tobytes()
    assert a.points().tobytes() == b.points().tobytes()


def test_the_same_frame_twice_is_at_the_same_place() -> None:
    slam = driven(5)
    frame = frames()[5]
    first = slam.localise(frame).T_map_base
    assert slam.localise(frame).T_map_base.tobytes() == first.tobytes()
    copy = slam.localise(replace(frame))
    assert distance(copy.T_map_base, first) < 1e-9
    slam.add(copy)
    slam.optimise()
    again = replace(frame, time=9.0)
    slam.add(slam.localise(again))
    slam.optimise()
    assert distance(slam.poses[-1], slam.poses[-2]) < 1e-3
    assert distance(slam.poses[-1], AROUND[5]) < 0.015


@pytest.mark.parametrize("depth", [0.0, np.nan])
def test_without_a_return_the_pose_is_that_of_the_odometry(depth: float) -> None:
    slam = driven(4)
    for k in (4, 5):
        blind = replace(frames()[k], depth=np.full_like(frames()[k].depth, depth))
        expected = slam.poses[-1] @ inverse(frames()[k - 1].T_odom_base) @ blind.T_odom_base
        match = slam.localise(blind)
        assert 0 < distance(match.T_map_base, expected) < 0.0065  # apart from learnt corrections of the odometry
        slam.add(match)
        slam.optimise()
    T = slam.localise(frames()[6]).T_map_base
    assert distance(T, AROUND[6]) < 0.01


def test_a_first_frame_without_a_return_is_a_keyframe_as_well() -> None:
    slam, first = Slam(), frames()[0]
    blind = replace(first, depth=np.zeros_like(first.depth))
    slam.add(slam.localise(blind))
    slam.optimise()
    np.testing.assert_allclose(slam.poses[0], AROUND[0], atol=1e-6)
    assert len(slam.points()) == 0
    assert distance(slam.localise(frames()[1]).T_map_base, frames()[1].T_odom_base) < 1e-3


def test_a_camera_that_has_stopped_is_noticed() -> None:
    slam = driven(3)
    stopped = replace(frames()[3], depth=frames()[2].depth.copy())
    with pytest.raises(LostError, match=r"3\.00 s"):
        slam.localise(stopped)


def test_a_camera_without_noise_in_a_plain_corridor_has_not_stopped() -> None:
    """The depth stays the same, but the colours change."""
    slam = driven(3)
    frame = replace(frames()[3], depth=frames()[2].depth.copy(), rgb=frames()[3].rgb + np.uint8(1))
    slam.localise(frame)


def test_a_camera_that_sees_the_same_while_the_robot_stands_has_not_stopped() -> None:
    slam = driven(3)
    T = slam.localise(replace(frames()[2], time=2.5)).T_map_base
    assert distance(T, AROUND[2]) < 0.01


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_odometry_that_is_not_finite_is_refused(value: float) -> None:
    slam = driven(2)
    T = frames()[2].T_odom_base.copy()
    T[0, 3] = value
    for localisation in (slam, Slam(), OdometryLocalisation()):
        with pytest.raises(LostError, match=r"odometry at 2\.00 s"):
            localisation.localise(replace(frames()[2], T_odom_base=T))
    assert distance(slam.localise(frames()[2]).T_map_base, AROUND[2]) < 0.01


def test_an_odometry_that_jumps_is_not_followed() -> None:
    """The odometry jumps once, and from then on only its origin is wrong."""
    slam, jump = driven(4), from_yaw(4.0, -3.0, 0, 2.0)
    for k in (4, 5, 6):
        frame = replace(frames()[k], T_odom_base=jump @ frames()[k].T_odom_base)
        slam.add(slam.localise(frame))
        slam.optimise()
    assert distance(slam.poses[-1], AROUND[6]) < 0.02


def blind(k: int) -> Frame:
    """The frame of index ``k`` without a return."""
    return replace(frames()[k], depth=np.zeros_like(frames()[k].depth))


def test_the_odometry_is_followed_however_far_away_the_last_keyframe_is() -> None:
    slam = driven(4)
    T = [slam.localise(blind(k)).T_map_base for k in range(4, 9)][-1]
    expected = slam.poses[-1] @ inverse(frames()[3].T_odom_base) @ frames()[8].T_odom_base
    assert distance(slam.poses[-1], T) > 1.4
    assert distance(T, expected) < 0.02


def test_an_odometry_that_has_jumped_is_followed_again() -> None:
    slam, jump = driven(4), from_yaw(4.0, -3.0, 0, 2.0)
    after = [replace(blind(k), T_odom_base=jump @ frames()[k].T_odom_base) for k in (4, 5, 6)]
    T = [slam.localise(frame).T_map_base for frame in after]
    assert distance(T[0], slam.poses[-1]) < 0.02
    assert distance(T[-1], T[0] @ inverse(frames()[4].T_odom_base) @ frames()[6].T_odom_base) < 1e-6


def test_wheels_that_slip_do_not_carry_the_robot_along() -> None:
    """The odometry measures 0.3 m, but the robot has not moved."""
    slam = driven(4)
    slipped = replace(seen(AROUND[3], AROUND[3], time=5), T_odom_base=frames()[4].T_odom_base)
    T = slam.localise(slipped).T_map_base
    assert distance(T, AROUND[3]) < 0.02
    assert slam.slips == 1
    assert slam.belief.state is MotionState.HELD


def test_wheels_that_slip_on_a_part_of_the_way_are_not_held() -> None:
    """The odometry measures 0.3 m, and the robot has moved by half of it."""
    slam, T = driven(4), AROUND[3] @ from_yaw(0.15, 0.0, 0.0, 0.0)
    slipped = replace(seen(T, T, time=5), T_odom_base=frames()[4].T_odom_base)
    assert distance(slam.localise(slipped).T_map_base, T) < 0.02
    assert slam.belief.state is MotionState.SLIPPING


def test_wheels_that_spin_before_a_long_wall_do_not_carry_the_robot_along() -> None:
    """The wall determines the robot's position ahead, and not to the side."""
    slam, poses, faces = Slam(), drive(*[(0.3, 0.0)] * 4), [floor(-3, 5, -20, 20), wall((5, -20), (5, 20))]
    for k, T in enumerate(poses):
        frame = seen(T, T, time=k, faces=faces)
        slam.add(slam.localise(frame))
        slam.optimise()
    spun = seen(poses[-1], poses[-1] @ from_yaw(0.3, 0.0, 0.0, 0.0), time=50, faces=faces)
    assert abs(slam.localise(spun).T_map_base[0, 3] - poses[-1][0, 3]) < 0.02
    assert slam.slips == 1


def test_where_most_of_a_frame_is_new_it_shows_where_it_was_taken_by_what_was_seen_before() -> None:
    slam, (here, there) = driven(4), AROUND[3:5]
    match = slam.localise(frames()[4])
    assert match.registration is not None and match.target is not None
    # As if the rest of the frame showed new ground, which says nothing.
    registered = [replace(match.registration, T=T, overlap=0.3) for T in (here, there)]
    held, moved = log_likelihoods(registered, match.target, frames()[4], LocalisationConfig().registration)
    assert moved > held + 3


def test_a_robot_that_was_set_down_goes_on_from_there() -> None:
    slam = driven(8)
    carried = [seen(T, from_yaw(7.0, 7.0, 0, -1.0) @ frames()[k].T_odom_base, k) for k, T in enumerate(AROUND[:3])]
    slam.set_pose(AROUND[0] @ from_yaw(0.05, -0.05, 0, 0.03))
    for k, frame in enumerate(carried):
        match = slam.localise(frame)
        assert distance(match.T_map_base, AROUND[k]) < 0.02
        slam.add(match)
        slam.optimise()
    errors = [distance(a, b) for a, b in zip(slam.poses, AROUND[:8] + AROUND[:3], strict=True)]
    assert max(errors) < 0.02


def test_a_robot_that_was_set_down_where_it_sees_nothing_stays_there_on_the_map() -> None:
    slam = driven(4)
    slam.optimise()
    there = AROUND[1] @ from_yaw(0.1, 0.1, 0.0, 1.0)
    slam.set_pose(there)
    frame = seen(there, frames()[3].T_odom_base, 9)
    frame = replace(frame, depth=np.zeros_like(frame.depth))
    slam.add(slam.localise(frame))
    slam.optimise()
    np.testing.assert_allclose(slam.poses[-1], there, atol=0.01)
    assert 0.1 < np.sqrt(slam.covariance[3, 3]) < 0.2  # as uncertain as a place that was found


def pictured(frame: Frame, shift: int, contrast: int = 200) -> Frame:
    """A frame with a colour image of stripes, ``shift`` pixels to the right, on a plain wall."""
    columns = 20 + contrast * ((np.arange(frame.intrinsics.width) + shift) // 20 % 2)
    return replace(frame, rgb=np.broadcast_to(np.uint8(columns)[None, :, None], (*frame.depth.shape, 3)).copy())


@pytest.mark.parametrize(("shift", "contrast", "is_held"), [(0, 200, True), (13, 200, False), (0, 2, False)])
def test_wheels_that_spin_while_the_view_stays_do_not_move_the_robot(
    shift: int, contrast: int, is_held: bool
) -> None:
    """It stands before a wall too near for its camera, so that only the colour image shows whether it moves.

    A wall that is almost plain would look the same if the robot moved.
    """
    slam, (frame, *_) = Slam(), frames()
    blind = replace(frame, depth=0 * frame.depth)
    slam.add(slam.localise(pictured(blind, 0, contrast)))
    for k in range(1, 9):
        T = frame.T_odom_base @ from_yaw(0.3 * k, 0, 0, 0)
        later = replace(blind, time=float(k), T_odom_base=T)
        slam.add(slam.localise(pictured(later, k * shift, contrast)))
    way = distance(slam.poses[0], slam.poses[-1])
    assert way < 0.05 if is_held else way > 2.3
    assert slam.slips == (8 if is_held else 0)


def test_where_loops_are_not_closed_there_are_none() -> None:
    slam = driven(6, Slam(closes_loops=False))
    assert slam.loops == []
    assert all(distance(a, b) > 0.1 for a, b in pairwise(slam.poses))


def test_a_bare_floor_does_not_shorten_a_drive() -> None:
    """Along a floor the nearest points always suggest that the robot has not moved."""
    poses, odometry = drive(*[(0.3, 0.0)] * 8), [floor(-3, 9, -9, 9)]
    slam = Slam()
    for k, T in enumerate(poses):
        frame = seen(T, T, time=k, faces=odometry)
        slam.add(slam.localise(frame))
    assert slam.slips == 0
    assert distance(slam.poses[-1], poses[-1]) < 0.01


def test_a_robot_that_has_seen_nothing_for_long_no_longer_knows_its_place() -> None:
    slam, first = Slam(), frames()[0]
    blank = replace(first, depth=np.zeros_like(first.depth))
    for k in range(6):
        assert slam.belief.knows_place
        frame = replace(blank, T_odom_base=from_yaw(0.65 * k, 0.0, 0.0, 0.0) @ first.T_odom_base, time=k / 10)
        slam.add(slam.localise(frame))
    assert not slam.belief.knows_place
    slam.set_pose(AROUND[0])
    assert slam.belief.knows_place


def test_a_turn_made_blind_is_corrected_when_it_ends_where_it_began() -> None:
    """The gyro is off by 0.5%, and walls are seen only at the start and at the end of the turn."""
    turns = drive(*[(0.0, np.pi / 12)] * 24)
    slam = Slam()
    for k, T in enumerate(turns):
        odometry = turns[0] @ from_yaw(0.0, 0.0, 0.0, k * np.pi / 12 * 1.005)
        frame = seen(T, odometry, time=k)
        is_blind = 2 < k < 22
        frame = replace(frame, depth=np.zeros_like(frame.depth)) if is_blind else frame
        slam.add(slam.localise(frame))
    slam.optimise()
    assert np.degrees(np.linalg.norm(logarithm(inverse(turns[-1]) @ slam.poses[-1])[:3])) < 0.2


@pytest.mark.parametrize(
    ("faces", "is_found"), [(ROOM, True), ([floor(-3, 5, -20, 20), wall((4, -20), (4, 20))], False)]
)
def test_a_robot_that_sees_again_after_a_blind_turn_finds_its_place_if_old_surfaces_determine_it(
    faces: list[Face], is_found: bool
) -> None:
    """It turned in view of the surfaces, then back without a view, and slid by 0.13 m unmeasured."""
    slam = Slam(config=LocalisationConfig(odometry=OdometryConfig(translation_sigma=0.08)))
    poses = drive(*TURN)
    for k, T in enumerate(poses):
        slam.add(slam.localise(seen(T, T, time=k, faces=faces)))
    for k, T in enumerate(poses[-2::-1]):
        frame = seen(T, T, time=10 + k, faces=faces)
        slam.add(slam.localise(replace(frame, depth=np.zeros_like(frame.depth))))
    assert slam.deviations[0] > LocalisationConfig().slam.local_deviation
    expected, T = slam.T_map_odom @ poses[0], from_yaw(0.1, 0.08, 0.0, 0.0) @ poses[0]
    match = slam.localise(seen(T, poses[0], time=20, faces=faces))
    assert (match.registration is not None) == is_found
    assert distance(match.T_map_base, T if is_found else expected) < 0.02


@pytest.mark.parametrize("distance_m", [3.3, 3.38, 3.46])
def test_the_limit_of_depth_takes_no_half_of_the_noise(distance_m: float) -> None:
    """A wall is measured with 2 cm of noise: the mean of the points that are used lies on the wall."""
    frame = frames()[0]
    noise = np.random.default_rng(0).normal(0, 0.02, frame.depth.shape)
    cloud = cloud_of_frame(replace(frame, depth=(distance_m + noise).astype(np.float32)), RegistrationConfig())
    assert (cloud is None) == (distance_m > 3.4)
    if cloud is not None:
        off = transform_points(inverse(frame.T_base_camera), cloud.points()[:, :3])[:, 2] - distance_m
        assert abs(off.mean()) < 0.005


@pytest.mark.parametrize(("on_ground", "low", "high"), [(True, 0.0, 0.02), (False, 0.025, 0.035)])
def test_a_robot_that_sees_walls_alone_stays_on_the_ground_that_it_has_seen(
    on_ground: bool, low: float, high: float
) -> None:
    """Walls do not show how high the robot is, and its odometry rises by 5 mm in each turn of 15°."""
    walls = [wall((4, -4), (4, 4)), wall((-2, 3), (4, 3))]
    poses, slam = drive(*[(0.3, 0.0)] * 4, *TURN), Slam(on_ground=on_ground)
    for k, T in enumerate(poses):
        turns = max(0, k - 4)
        risen = from_yaw(0.0, 0.0, 0.005 * turns, 0.0) @ T
        frame = seen(T, risen, time=k, faces=walls if turns else [floor(-3, 5, -3, 3), *walls])
        slam.add(slam.localise(frame))
        slam.optimise()
    assert low <= abs(slam.poses[-1][2, 3] - poses[-1][2, 3]) <= high


def test_the_less_certain_a_surface_is_the_less_it_weighs() -> None:
    """A weight is an inverse variance: that of the registration plus that of the surface."""
    np.testing.assert_allclose(certainty(np.array([0.0, 0.1, 0.2, 1.0]), half=0.1), [1, 1 / 2, 1 / 5, 1 / 101])
