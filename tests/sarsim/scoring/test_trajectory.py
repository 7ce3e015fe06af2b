import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.localisation.localisation import LocalisedFrame, Loop
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.trajectory import write_tum
from pipeline.transforms import from_rotation, from_yaw, inverse
from sarsim.robots.pose import TrajectorySample
from sarsim.scoring.trajectory import TrajectoryScore, distance_driven, motion_figures


def straight(length, drift=0.0):
    xs = np.linspace(0, length, 101)
    return [TrajectorySample(t, from_yaw(x, 0, 0, 0), from_yaw(x, drift * x, 0, 0)) for t, x in enumerate(xs)]


def scored(trajectory, keyframes=(), poses=(), loops=()):
    """The score of a trajectory of which some poses, by index, are keyframes with the estimates ``poses``."""
    localisation, grown = OdometryLocalisation(), []
    score = TrajectoryScore(localisation, grown)
    for n, pose in enumerate(trajectory):
        grown.append(pose)
        if n in keyframes:
            score.add()
    for T in poses:
        localisation.add(LocalisedFrame(None, T))
    localisation.loops.extend(loops)
    return score


def test_truth_has_no_error():
    report = scored(straight(2.0)).report()
    nothing = ("keyframes", "loops", "false_loops")
    assert report == {"ate_rmse_m": 0, "heading_rmse_deg": 0, "drift_percent": 0} | dict.fromkeys(nothing, 0)


def test_drift_is_the_error_at_the_end_over_the_way():
    report = scored(straight(2.0, drift=0.05)).report()
    assert report["drift_percent"] == pytest.approx(5.0)
    assert report["ate_rmse_m"] == pytest.approx(0.1 / np.sqrt(3), rel=0.02)


@pytest.mark.parametrize("poses", [2, 5, 101, 20_001])
def test_drift_of_a_recording_does_not_depend_on_how_many_poses_it_has(poses):
    # 2 m on and 1.5 m up a ramp, in the end 5 cm off: 2%
    share = np.linspace(0, 1, poses)
    ways = [(from_yaw(2 * s, 0, 1.5 * s, 0), from_yaw(2 * s, 0.05 * s, 1.5 * s, 0)) for s in share]
    score = scored([TrajectorySample(t, true, believed) for t, (true, believed) in enumerate(ways)])
    score.is_recorded = True
    assert score.report()["drift_percent"] == pytest.approx(2.0)


def test_errors_of_heading_are_those_the_short_way_around():
    trajectory = [TrajectorySample(0, from_yaw(0, 0, 0, np.pi - 0.05), from_yaw(0, 0, 0, -np.pi + 0.05))]
    report = scored(trajectory).report()
    assert report["heading_rmse_deg"] == pytest.approx(np.degrees(0.1))
    assert report["drift_percent"] == 0  # of a robot that did not drive


def test_where_it_believes_to_have_been_is_the_keyframe_before_and_the_odometry_since():
    trajectory = straight(2.0, drift=0.05)
    keyframes = 10, 60
    poses = [from_yaw(0.2, 1.0, 0, 0), from_yaw(1.2, 0.0, 0, np.pi / 2)]
    estimated = scored(trajectory, keyframes, poses).estimated()
    np.testing.assert_allclose(estimated[0][:2, 3], (0.0, 0.99))  # before the first keyframe: odometry back from it
    np.testing.assert_allclose(estimated[10], poses[0])
    np.testing.assert_allclose(estimated[59][:2, 3], (1.18, 1.049))
    np.testing.assert_allclose(estimated[60], poses[1])
    np.testing.assert_allclose(estimated[100][:2, 3], (1.2 - 0.04, 0.8))  # the estimate's y is along the odometry's x


@given(st.sets(st.integers(0, 100), min_size=1, max_size=8), st.floats(-3, 3), st.floats(-3, 3))
def test_keyframes_at_the_odometrys_poses_change_nothing(keyframes, x, yaw):
    trajectory = straight(2.0, drift=0.05)
    T = from_yaw(x, 1, 0, yaw)
    score = scored(trajectory, keyframes, [T @ trajectory[n].T_odom_base for n in sorted(keyframes)])
    np.testing.assert_allclose(score.estimated(), [T @ pose.T_odom_base for pose in trajectory], atol=1e-12)
    assert score.report()["keyframes"] == len(keyframes)


@pytest.mark.parametrize(
    ("off", "is_false"),
    [
        (from_yaw(0.19, 0, 0, 0), False),
        (from_yaw(0, 0.15, 0.15, 0), True),
        (from_yaw(0, 0, 0, np.deg2rad(-4.9)), False),
        (from_yaw(0, 0, 0, np.deg2rad(5.1)), True),
    ],
)
def test_a_loop_is_false_whose_relative_pose_is_off(off, is_false):
    trajectory = [TrajectorySample(t, from_yaw(t, 1, 0, 0.5 * t), np.eye(4)) for t in range(4)]
    true = inverse(trajectory[1].T_world_base) @ trajectory[3].T_world_base
    loops = [Loop(0, 1, true @ off), Loop(0, 1, true)]
    report = scored(trajectory, (1, 3), [pose.T_world_base for pose in trajectory[1::2]], loops).report()
    assert (report["loops"], report["false_loops"]) == (2, is_false)


def test_where_the_truth_is_unknown_nothing_is_compared():
    unknown = np.full((4, 4), np.nan)
    believed = [from_yaw(t, t == 1, 0, 0) for t in range(4)]  # off by 1 m where the truth is unknown
    trajectory = [TrajectorySample(t, unknown if t == 1 else from_yaw(t, 0, 0, 0), T) for t, T in enumerate(believed)]
    loops = [Loop(0, 1, np.eye(4)), Loop(0, 2, np.eye(4))]
    report = scored(trajectory, (0, 1, 2), believed[:3], loops).report()
    assert report["ate_rmse_m"] == report["drift_percent"] == 0
    assert (report["loops"], report["false_loops"]) == (2, 1)


def test_distance_is_the_length_of_the_way():
    assert distance_driven(straight(2.0)) == pytest.approx(2.0)
    assert distance_driven(straight(0.01)) == 0


def test_a_robot_that_was_lifted_did_not_drive_that_way():
    there = [TrajectorySample(0, from_yaw(9, 9, 0, 0), np.eye(4))]
    assert distance_driven(straight(2.0) + there + there + straight(1.0)) == pytest.approx(3.0)


def test_tilt_and_tipping():
    rolls = np.deg2rad([0, 10, -20, 60, 80, 0, 50])
    poses = [
        TrajectorySample(t, from_rotation(Rotation.from_euler("x", r).as_matrix(), np.zeros(3)), np.eye(4))
        for t, r in enumerate(rolls)
    ]
    figures = motion_figures(poses)
    assert figures["max_roll_deg"] == pytest.approx(80) and figures["max_pitch_deg"] == pytest.approx(0)
    assert figures["tipped"] == 2


def test_tum_files_read_back(tmp_path):
    poses = [from_yaw(1, 2, 3, 0.3), from_yaw(4, 5, 6, -2)]
    write_tum(tmp_path / "t.tum", [0.5, 1.5], poses)
    rows = np.loadtxt(tmp_path / "t.tum")
    assert rows[:, 0].tolist() == [0.5, 1.5]
    for row, T in zip(rows, poses, strict=True):
        np.testing.assert_allclose(from_rotation(Rotation.from_quat(row[4:]).as_matrix(), row[1:4]), T, atol=1e-5)
