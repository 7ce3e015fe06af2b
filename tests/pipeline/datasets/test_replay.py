"""Recordings through the mapper."""

import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.datasets.recording import CameraPose, Recording
from pipeline.datasets.replay import PoseSource, Replay, Replayed, default_pose_source, localisation_of
from pipeline.errors import InputError
from pipeline.localisation.trajectory import Trajectory
from pipeline.mapper import Mapper
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_rotation, from_yaw, inverse
from tests.pipeline.datasets.recorded_room import ODOMETRY, WAY, camera_poses, frames
from tests.pipeline.localisation.driving_robot import ROOM, T_BASE_CAMERA, seen
from tests.pipeline.polygon_scene import wedge
from tests.pipeline.robot_model import PIONEER

TIMES = np.array([frame.time for frame in frames()])


def recording(**known) -> Recording:
    blank = [replace(frame, T_odom_base=np.eye(4)) for frame in frames()]
    return Recording(Path("room"), lambda: iter(blank), has_camera_pose=True, **known)


def replayed(source: Recording, poses: PoseSource) -> tuple[Mapper, list[Replayed]]:
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=localisation_of(poses))
    return mapper, list(Replay(source, mapper, poses))


def errors(found: list[Replayed], mapper: Mapper) -> np.ndarray:
    """(N,) m, errors of the frames' estimated positions relative to the first frame."""
    T_odom_base = [T.frame.T_odom_base for T in found]
    T_map_base = [mapper.localisation.T_map_odom @ T for T in T_odom_base]
    true = [T_map_base[0] @ inverse(WAY[0]) @ T for T in WAY]
    return np.linalg.norm((np.array(T_map_base) - true)[:, :3, 3], axis=1)


def test_registration_alone_follows_the_camera() -> None:
    mapper, found = replayed(recording(), "registration")
    assert len(found) == len(WAY)
    assert errors(found, mapper).max() < 0.02
    assert sum(r.keyframe is not None for r in found) == len(mapper.keyframes) < len(WAY)


def test_odometry_is_corrected_or_taken_at_its_word() -> None:
    odometry = Trajectory(TIMES, np.array(ODOMETRY))
    assert default_pose_source(recording(odometry=odometry)) == "slam"
    assert default_pose_source(recording()) == "registration"
    mapper, found = replayed(recording(odometry=odometry), "slam")
    assert np.linalg.norm((mapper.keyframes.poses[-1] - WAY[last_keyframe(found)])[:3, 3]) < 0.018
    trusted, found = replayed(recording(odometry=odometry), "odometry")
    np.testing.assert_allclose(trusted.keyframes.poses[-1], ODOMETRY[last_keyframe(found)], atol=1e-12)
    assert np.linalg.norm((trusted.keyframes.poses[-1] - WAY[last_keyframe(found)])[:3, 3]) > 0.025


def last_keyframe(found: list[Replayed]) -> int:
    return max(k for k, r in enumerate(found) if r.keyframe is not None)


def test_true_poses_of_the_camera_become_those_of_the_robot() -> None:
    truth = Trajectory(TIMES, np.array(camera_poses(WAY)), of_camera=True)
    mapper, found = replayed(recording(truth=truth), "truth")
    np.testing.assert_allclose(mapper.keyframes.poses[0], WAY[0], atol=1e-12)
    np.testing.assert_allclose([r.T_world_base for r in found], WAY, atol=1e-12)


@pytest.mark.parametrize("clip", [10.0, 4.5, np.float32(12.1)])
def test_a_depth_that_stands_for_no_return_is_none(clip: float) -> None:
    whole = recording(truth=Trajectory(TIMES, np.array(WAY)))
    holes = [replace(f, depth=np.where(np.arange(320) < 80, 0, f.depth).astype(np.float32)) for f in whole.frames()]
    clipped = [replace(f, depth=np.where(f.depth > 0, f.depth, clip).astype(np.float32)) for f in holes]
    whole.frames = lambda: iter(clipped)
    _, found = replayed(whole, "truth")
    for r, true in zip(found, holes, strict=True):
        np.testing.assert_array_equal(r.frame.depth, true.depth)
    (note,) = whole.notes
    assert f"{clip:g} m" in note


ON_ITS_SIDE = from_rotation(
    Rotation.from_euler("xyz", [110, 20, 30], degrees=True).as_matrix(), np.array([3.0, 1, 2])
)
"""4×4 pose of the room in a world whose z is not up."""


def hand_held(**known) -> Recording:
    """A recording of a camera whose pose on the robot is unknown."""
    held = [replace(frame, T_odom_base=np.eye(4), T_base_camera=np.eye(4)) for frame in frames()]
    return Recording(Path("room"), lambda: iter(held), **known)


def tilt(T: np.ndarray) -> float:
    """Degrees between z of the map and of a robot on level ground."""
    return float(np.degrees(np.arccos(np.clip(T[2, 2], -1, 1))))


@pytest.mark.parametrize("felt", [None, T_BASE_CAMERA[2, :3]], ids=["surfaces", "accelerometer"])
def test_z_is_up_whatever_the_true_poses_call_so(felt: np.ndarray | None) -> None:
    poses = ON_ITS_SIDE @ np.array(camera_poses(WAY))
    mapper, found = replayed(hand_held(truth=Trajectory(TIMES, poses, of_camera=True), up=felt), "truth")
    T_map_base = np.array([r.frame.T_odom_base for r in found])
    assert tilt(T_map_base[0]) < 1e-5  # rounding
    assert max(map(tilt, T_map_base)) < (1 if felt is None else 1e-5)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(T_map_base[:, :3, 3], axis=0), axis=1),
        np.linalg.norm(np.diff(np.array(WAY)[:, :3, 3], axis=0), axis=1),
        atol=0.01,
    )
    np.testing.assert_allclose(found[0].T_world_base @ found[0].frame.T_base_camera, poses[0], atol=1e-9)
    assert len(mapper.keyframes)


def test_registration_alone_levels_a_hand_held_camera() -> None:
    source = hand_held()
    _, found = replayed(replace(source, frames=lambda: islice(source.frames(), 9)), "registration")
    assert max(tilt(r.frame.T_odom_base) for r in found) < 1.5


def test_z_of_known_poses_stays_up_on_a_slope() -> None:
    """Ground that the robot drives on says nothing against the poses."""
    slope = from_rotation(Rotation.from_euler("y", 12, degrees=True).as_matrix(), np.zeros(3))
    way = slope @ np.array(WAY)
    _, found = replayed(recording(truth=Trajectory(TIMES, way)), "truth")
    np.testing.assert_allclose([r.frame.T_odom_base for r in found], way, atol=1e-12)


def test_frames_before_the_first_true_pose_are_left_out() -> None:
    poses = ON_ITS_SIDE @ np.array(camera_poses(WAY))
    source = hand_held(truth=Trajectory(TIMES[3:], poses[3:], of_camera=True))
    _, found = replayed(source, "truth")
    assert [r.frame.time for r in found] == TIMES[3:].tolist()
    assert tilt(found[0].frame.T_odom_base) < 1e-6
    assert source.left_out == {"frames without a known pose": 3}


def test_what_shows_no_vertical_is_refused() -> None:
    blank = [replace(frame, depth=np.where(frame.depth > 0, np.float32(2), 0)) for frame in hand_held().frames()][:4]
    source = replace(hand_held(truth=Trajectory(TIMES, np.array(WAY), of_camera=True)), frames=lambda: iter(blank))
    for poses in ("truth", "registration"):
        with pytest.raises(InputError, match=r"room: .* vertical; .*--camera-pose"):
            replayed(source, poses)


def test_recorded_keyframes_are_made_again() -> None:
    chosen = {TIMES[0]: True, TIMES[3]: False, TIMES[5]: True}
    mapper, found = replayed(recording(odometry=Trajectory(TIMES, np.array(ODOMETRY)), keyframes=chosen), "slam")
    made = {r.frame.time: len(r.keyframe.labels) > 0 for r in found if r.keyframe is not None}
    assert made == chosen
    assert len(mapper.keyframes) == 3


def test_frames_in_a_gap_of_the_odometry_are_left_out() -> None:
    kept = (TIMES < 0.35) | (TIMES > 0.95)
    source = recording(odometry=Trajectory(TIMES[kept], np.array(ODOMETRY)[kept]))
    _, found = replayed(source, "slam")
    assert [r.frame.time for r in found] == TIMES[kept].tolist()
    assert source.left_out == {"frames without a known pose": np.count_nonzero(~kept)}


def test_poses_that_are_not_there_are_refused() -> None:
    with pytest.raises(InputError, match=r"room: .*--poses truth"):
        replayed(recording(), "truth")
    with pytest.raises(InputError, match=r"room: .*--poses slam"):
        replayed(recording(), "slam")


def test_angles_of_a_camera_are_those_of_rep_103() -> None:
    T = CameraPose(0.1, 0.0, 0.6, 0.0, np.degrees(0.25), 0.0).T_base_camera
    np.testing.assert_allclose(T, T_BASE_CAMERA, atol=1e-12)


def test_the_six_numbers_of_a_camera_come_back() -> None:
    pose = CameraPose(0.1, -0.2, 0.6, 4.0, 12.0, -30.0)
    assert CameraPose.of(pose.T_base_camera) == pytest.approx(pose)


TILTED = CameraPose(0.1, 0.0, 0.6, 0.0, np.degrees(0.25) + 20, 0.0).T_base_camera
"""A pose that is wrong by 20°."""


@pytest.mark.parametrize(
    ("recorded", "felt"),
    [
        (None, T_BASE_CAMERA[2, :3]),
        (T_BASE_CAMERA, np.array([0.0, 0.0, 1.0])),
        (TILTED, TILTED[:3, :3] @ T_BASE_CAMERA[2, :3]),
    ],
    ids=["unknown", "right", "wrong"],
)
def test_the_vertical_fits_the_given_pose_of_the_camera(recorded: np.ndarray | None, felt: np.ndarray) -> None:
    # A recorded pose that is wrong turns what an accelerometer on the camera measures.
    place = np.eye(4) if recorded is None else recorded
    source = recording(odometry=Trajectory(TIMES, np.array(ODOMETRY)), up=felt)
    taken = [replace(frame, T_base_camera=place) for frame in source.frames()][:6]
    source = replace(source, frames=lambda: iter(taken), has_camera_pose=recorded is not None)
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=localisation_of("slam"))
    found = list(Replay(source, mapper, "slam", T_BASE_CAMERA))
    assert max(tilt(mapper.localisation.T_map_odom @ r.frame.T_odom_base) for r in found) < 1
    assert any("accelerometer" in note for note in source.notes) == (recorded is TILTED)


RAMP = [*ROOM, *wedge(1.9, 1.5, 1.2, 1.5, 0.45)]
"""A room with a ramp of 21° ahead, which takes up more of the view than the floor."""


@pytest.mark.parametrize("start", [0.6, 1.0])
def test_the_walls_and_later_frames_tell_a_ramp_from_the_floor(start: float) -> None:
    way = [from_yaw(start + 0.05 * k, 1.5, 0, 0.0) for k in range(4)] + [
        from_yaw(start + 0.2, 1.5, 0, 0.1 * k) for k in range(1, 12)
    ]
    held = [
        replace(seen(T, T, time=k, faces=RAMP), T_base_camera=np.eye(4), T_odom_base=np.eye(4))
        for k, T in enumerate(way)
    ]
    source = Recording(Path("ramp"), lambda: iter(held))
    _, (found, *_) = replayed(source, "registration")
    T = found.frame.T_base_camera
    assert T[2, 3] == pytest.approx(T_BASE_CAMERA[2, 3], abs=0.03)
    assert np.degrees(np.arccos(np.clip(T[2, :3] @ T_BASE_CAMERA[2, :3], -1, 1))) < 2


@pytest.mark.parametrize(
    ("scale", "camera", "said", "refused"),
    [
        (0.2, {}, "median depth is .* --depth-scale", False),
        (10.0, {}, "median depth is .* --depth-scale", False),
        (1000.0, {}, "median depth is .* --depth-scale", True),
        (1.0, {"cx": 120.0, "cy": 160.0}, "159.5 .* 320 × 240 pixels, as the principal point", False),
        (1.0, {"cx": 320.0, "cy": 240.0, "fx": 577.0, "fy": 577.0}, "320 × 240 .* principal point", False),
        (1.0, {"cx": 0.5, "cy": 0.5, "fx": 0.9, "fy": 1.2}, "320 × 240 .* --intrinsics", True),
        (1.0, {"cx": 960.0, "cy": 540.0}, "320 × 240 .* --intrinsics", True),
    ],
)
def test_what_is_implausible_about_a_camera_is_said(
    scale: float, camera: dict[str, float], said: str, refused: bool
) -> None:
    source = recording(truth=Trajectory(TIMES, np.array(WAY)))
    odd = [
        replace(f, depth=f.depth * np.float32(scale), intrinsics=replace(f.intrinsics, **camera))
        for f in islice(source.frames(), 2)
    ]
    source.frames = lambda: iter(odd)
    if refused:
        with pytest.raises(InputError, match=f"room: .*{said}"):
            replayed(source, "truth")
    else:
        replayed(source, "truth")
        assert any(re.search(said, note) for note in source.notes)
