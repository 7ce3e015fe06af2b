"""Motions by odometry as constraints, against the motion model and against differences."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.motion_model import MeasuredMotion
from pipeline.localisation.pose_graph import Constraints, PoseGraph, adjoints
from pipeline.localisation.registration import exponential, logarithm
from pipeline.transforms import from_yaw, inverse

STEP = 1e-6


def motions(seed: int) -> tuple[list[MeasuredMotion], NDArray[np.float64]]:
    """Three motions with turns and tilts, and systematic errors of the odometry."""
    rng = np.random.default_rng(seed)
    every = []
    for _ in range(3):
        up = np.array([*rng.normal(0, 0.1, 2), 1.0])
        every.append(MeasuredMotion(exponential(rng.normal(0, 0.2, 6)), up / np.linalg.norm(up), rng.uniform(0, 2)))
    return every, rng.normal(0, 0.01, 7)


def driven(every: list[MeasuredMotion], errors: NDArray[np.float64]) -> tuple[Constraints, NDArray[np.float64]]:
    """The constraints of motions, and poses that follow them exactly."""
    graph = PoseGraph(LocalisationConfig())
    graph.add(from_yaw(1, 2, 0, 0.5), every[0].up)
    for motion in every:
        graph.add(graph.poses[-1] @ motion.without(errors), motion.up)
        graph.add_motion(motion)
    return graph.constraints, graph.poses


@given(st.integers(0, 100))
def test_poses_that_follow_the_corrected_motions_leave_no_residual(seed: int) -> None:
    drives, poses = driven(*(both := motions(seed)))
    np.testing.assert_allclose(drives.residuals(poses, both[1]), 0, atol=1e-9)


@given(st.integers(0, 100), st.integers(1, 3), st.integers(0, 5))
def test_a_residual_is_the_deviation_in_standard_deviations(seed: int, which: int, axis: int) -> None:
    drives, poses = driven(*(both := motions(seed)))
    off = 1e-3 * np.eye(6)[axis]
    poses[which] = poses[which] @ exponential(off)
    noise = both[0][which - 1].noise(LocalisationConfig().odometry)
    squared = np.sum(np.square(drives.residuals(poses, both[1])[which - 1]))
    np.testing.assert_allclose(squared, off @ np.linalg.solve(noise, off), rtol=1e-3)


@given(st.integers(0, 100), st.integers(0, 5))
def test_derivatives_are_those_of_small_differences(seed: int, axis: int) -> None:
    every, errors = motions(seed)
    drives, poses = driven(every, errors)
    moved = exponential(STEP * np.eye(6)[axis])
    for later, derivatives in enumerate(drives.jacobians(poses)[:2]):
        for which, derivative in enumerate(derivatives):
            at = poses.copy()
            at[which + later] = at[which + later] @ moved
            found = drives.residuals(at, errors)[which] / STEP
            np.testing.assert_allclose(found, derivative[:, axis], rtol=1e-3, atol=0.05)


@given(st.integers(0, 100), st.integers(0, 6))
def test_what_the_errors_change_is_known_for_small_turns(seed: int, which: int) -> None:
    drives, poses = driven(*(both := motions(seed)))
    errors = both[1] + STEP * np.eye(7)[which]
    derivatives = drives.jacobians(poses)[2][:, :, which]
    found = drives.residuals(poses, errors) / STEP
    np.testing.assert_allclose(found, derivatives, atol=0.2 * np.abs(derivatives).max() + 0.05)


@given(st.integers(0, 100))
def test_an_adjoint_turns_tangents(seed: int) -> None:
    T, tangent = (np.random.default_rng(seed).normal(size=6) for _ in range(2))
    T, small = exponential(T), STEP * tangent
    found = logarithm(T @ exponential(small) @ inverse(T)) / STEP
    np.testing.assert_allclose(found, adjoints(T[None])[0] @ tangent, atol=1e-4)
