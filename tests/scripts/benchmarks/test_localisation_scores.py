"""Errors of trajectories, by hand and beside evo's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.localisation.trajectory import write_tum
from pipeline.transforms import from_rotation, from_yaw
from scripts.benchmarks.localisation_scores import (
    distances_driven,
    errors_of,
    evo_ate,
    nees,
    trajectory_scores,
    within,
)


def line(n=31, yaw=0.0, scale=1.0):
    """(n, 4, 4) poses every 0.1 m along a line from the origin."""
    s = 0.1 * scale * np.arange(n)
    return np.array([from_yaw(d * np.cos(yaw), d * np.sin(yaw), 0, yaw) for d in s])


def wandering(seed, n=60):
    """(n, 4, 4) poses of a body that moves and turns in space."""
    rng = np.random.default_rng(seed)
    poses = [np.eye(4)]
    for _ in range(n - 1):
        step = from_rotation(Rotation.from_rotvec(0.1 * rng.standard_normal(3)).as_matrix(), rng.normal(0, 0.1, 3))
        poses.append(poses[-1] @ step)
    return np.array(poses)


def test_an_offset_is_an_absolute_error_and_no_relative_one():
    moved = line()
    moved[:, 1, 3] += 0.3
    scores = trajectory_scores(line(), moved)
    assert distances_driven(line(3)) == pytest.approx([0, 0.1, 0.2])
    expected = {"ate_m": 0.3, "max_m": 0.3, "heading_deg": 0, "rpe_m": 0, "rpe_deg": 0, "drift_percent": 10}
    assert scores == pytest.approx(expected, abs=1e-6)  # 0.3 m after 3 m


def test_a_wrong_scale_is_a_relative_error_over_a_metre():
    scores = trajectory_scores(line(), line(scale=1.02))
    assert scores["rpe_m"] == pytest.approx(0.02)
    assert scores["max_m"] == pytest.approx(0.06)
    assert scores["drift_percent"] == pytest.approx(2)


def test_a_wrong_heading_counts_across_the_half_turn():
    scores = trajectory_scores(line(yaw=np.deg2rad(179)), line(yaw=np.deg2rad(-179)))
    assert scores["heading_deg"] == pytest.approx(2)


@pytest.mark.parametrize("seed", range(3))
def test_the_absolute_error_is_evos(tmp_path, seed):
    true, estimated = wandering(seed), wandering(seed + 10)
    times = [0.04 * n for n in range(len(true))]
    for name, poses in (("true", true), ("estimated", estimated)):
        write_tum(tmp_path / name, times, list(poses))
    ate = trajectory_scores(true, estimated)["ate_m"]
    assert ate > 0.1
    assert ate == pytest.approx(evo_ate(tmp_path / "true", tmp_path / "estimated"), abs=1e-6)


def test_errors_lead_from_the_estimate_to_the_truth():
    estimated = wandering(1)
    error = from_rotation(Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix(), [1, 2, 3])
    assert errors_of(estimated @ error, estimated) == pytest.approx(np.tile([0.1, -0.2, 0.3, 1, 2, 3], (60, 1)))


def test_nees_is_one_where_covariances_are_right_and_four_where_errors_are_twice_as_large():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((6, 6))
    errors = rng.standard_normal((20_000, 6)) @ root.T
    covariances = np.tile(root @ root.T, (len(errors), 1, 1))
    assert nees(errors, covariances) == pytest.approx(1, abs=0.02)
    assert nees(2 * errors, covariances) == pytest.approx(4, abs=0.08)


def test_of_normal_errors_997_in_1000_are_within_three_deviations():
    errors = np.random.default_rng(0).normal(0, [1, 2, 3, 4, 5, 6], (5000, 6))
    covariances = np.broadcast_to(np.diag(np.square([1.0, 2, 3, 4, 5, 6])), (5000, 6, 6))
    assert within(3, errors, covariances) == pytest.approx(0.9973, abs=0.001)
    assert within(1, errors, covariances) == pytest.approx(0.6827, abs=0.01)
