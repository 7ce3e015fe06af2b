import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.transforms import from_rotation, from_yaw
from sarsim.robots.pose import Pose
from sarsim.scoring.trajectory import driven, greatest_tilt, score_localisation, times_tipped, write_tum


def straight(length, drift=0.0):
    xs = np.linspace(0, length, 101)
    return [Pose(t, from_yaw(x, 0, 0, 0), from_yaw(x, drift * x, 0, 0)) for t, x in enumerate(xs)]


def test_truth_has_no_error():
    assert score_localisation(straight(2.0)) == {"ate_rmse_m": 0, "drift_percent": 0}


def test_drift_is_the_error_at_the_end_over_the_way():
    score = score_localisation(straight(2.0, drift=0.05))
    assert score["drift_percent"] == pytest.approx(5.0)
    assert score["ate_rmse_m"] == pytest.approx(0.1 / np.sqrt(3), rel=0.02)


def test_distance_is_the_length_of_the_way():
    assert driven(straight(2.0)) == pytest.approx(2.0)
    assert driven(straight(0.01)) == 0


def test_a_robot_that_was_lifted_did_not_drive_that_way():
    there = [Pose(0, from_yaw(9, 9, 0, 0), np.eye(4))]
    assert driven(straight(2.0) + there + there + straight(1.0)) == pytest.approx(3.0)


def test_tilt_and_tipping():
    rolls = np.deg2rad([0, 10, -20, 60, 80, 0, 50])
    poses = [
        Pose(t, from_rotation(Rotation.from_euler("x", r).as_matrix(), np.zeros(3)), np.eye(4))
        for t, r in enumerate(rolls)
    ]
    assert np.degrees(greatest_tilt(poses)) == pytest.approx([80, 0])
    assert times_tipped(poses) == 2


def test_tum_files_read_back(tmp_path):
    poses = [from_yaw(1, 2, 3, 0.3), from_yaw(4, 5, 6, -2)]
    write_tum(tmp_path / "t.tum", [0.5, 1.5], poses)
    rows = np.loadtxt(tmp_path / "t.tum")
    assert rows[:, 0].tolist() == [0.5, 1.5]
    for row, T in zip(rows, poses, strict=True):
        np.testing.assert_allclose(from_rotation(Rotation.from_quat(row[4:]).as_matrix(), row[1:4]), T, atol=1e-5)
