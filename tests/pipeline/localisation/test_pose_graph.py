"""The pose graph against results that can be computed by hand."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.motion_model import MeasuredMotion
from pipeline.localisation.pose_graph import ConstraintKind, PoseGraph
from pipeline.transforms import from_rotation, from_yaw, inverse, roll_pitch_of, yaw_of

CONFIG = LocalisationConfig()
SURE, VAGUE = 1e4 * np.eye(6), 10 * np.eye(6)
UP = np.array([0.0, 0.0, 1.0])


def chain(edges: list[NDArray[np.float64]], information: NDArray[np.float64] = SURE) -> PoseGraph:
    """A graph of keyframes one after the other, level by the odometry."""
    graph = PoseGraph(CONFIG)
    graph.add(np.eye(4), UP)
    for k, edge in enumerate(edges):
        T = graph.poses[k] @ edge
        graph.connect(k, graph.add(T, UP), T, information, ConstraintKind.MOTION)
    return graph


def tilted(roll: float, pitch: float) -> NDArray[np.float64]:
    return from_rotation(Rotation.from_euler("xy", [roll, pitch], degrees=True).as_matrix(), np.zeros(3))


def test_a_square_closes() -> None:
    """Each side is 2 m long and measured 2% too long, each corner 2° too wide."""
    edges = [from_yaw(2.04, 0, 0, np.deg2rad(92))] * 4
    graph = chain(edges, 1e3 * np.eye(6))
    assert np.linalg.norm(graph.poses[-1][:2, 3]) > 0.19
    graph.connect(0, 4, graph.poses[0], SURE, ConstraintKind.MOTION)
    graph.optimise()
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)]
    errors = np.linalg.norm(graph.poses[:, :2, 3] - corners, axis=1)
    assert errors[-1] < 0.06
    assert errors.max() < 0.1
    assert abs(yaw_of(graph.poses[-1])) < np.deg2rad(2)
    np.testing.assert_allclose(graph.poses[0], np.eye(4), atol=1e-6)


def test_a_full_turn_after_which_the_robot_leans_fits_the_poses_that_it_joins() -> None:
    graph, T = PoseGraph(CONFIG), tilted(5, 3)
    graph.add(np.eye(4), UP)
    graph.add(T, T[2, :3])
    graph.add_motion(MeasuredMotion(T, UP, 20.0, 2 * np.pi))
    assert graph.chi2().max() < 1e-6


@given(st.integers(2, 6), st.floats(0.97, 1.03), st.floats(0.1, 10))
def test_what_a_loop_contradicts_is_spread_evenly(edges: int, length: float, ratio: float) -> None:
    """Of n edges d with information 1 and a loop of n m with information r the mean is d + nr (1 - d) / (1 + nr)."""
    graph = chain([from_yaw(length, 0, 0, 0)] * edges, VAGUE)
    graph.connect(0, edges, from_yaw(edges, 0, 0, 0), ratio * VAGUE, ConstraintKind.MOTION)
    graph.optimise()
    share = edges * ratio / (1 + edges * ratio)
    expected = np.arange(edges + 1) * (length + share * (1 - length))
    np.testing.assert_allclose(graph.poses[:, 0, 3], expected, atol=2e-3)


@pytest.mark.parametrize("kind", ConstraintKind)
def test_a_false_constraint_is_outvoted(kind: ConstraintKind) -> None:
    graph = chain([from_yaw(0.5, 0, 0, 0.2)] * 5)
    for k in range(2, 6):
        graph.connect(k - 2, k, graph.poses[k], SURE, ConstraintKind.SURFACE)
    before = graph.poses.copy()
    graph.connect(0, 5, graph.poses[5] @ from_yaw(0.0, 1.0, 0, 0), SURE, kind)
    graph.optimise()
    moved = np.linalg.norm(graph.poses[5][:3, 3] - before[5][:3, 3])
    assert moved < 0.01


def test_a_true_loop_counts_although_it_may_be_an_outlier() -> None:
    graph = chain([from_yaw(0.51, 0, 0, 0)] * 4)
    graph.connect(0, 4, from_yaw(2.0, 0, 0, 0), SURE, ConstraintKind.LOOP)
    graph.optimise()
    assert 2.005 < graph.poses[4][0, 3] < 2.02


def test_gravity_levels_what_registration_has_tilted() -> None:
    graph = chain([tilted(2, 0), tilted(-4, 0), tilted(2, 3), tilted(0, -6)], VAGUE)
    graph.optimise()
    assert max(abs(angle) for T in graph.poses for angle in roll_pitch_of(T)) < np.deg2rad(0.75)
    spread = np.ptp([roll_pitch_of(T) for T in graph.poses], axis=0)
    assert spread.max() < np.deg2rad(0.1)


def test_a_start_on_a_slope_stays_where_the_odometry_has_it() -> None:
    T, graph = tilted(5, -10), PoseGraph(CONFIG)
    graph.add(T, T[2, :3])
    graph.add(np.eye(4), UP)
    graph.connect(0, 1, np.eye(4), SURE, ConstraintKind.MOTION)
    graph.optimise()
    np.testing.assert_allclose(graph.poses, [T, np.eye(4)], atol=1e-6)


def test_a_level_that_is_mounted_askew_tilts_nothing() -> None:
    askew, graph = tilted(1, 2), PoseGraph(CONFIG)
    for k, yaw in enumerate((0.0, 1.0, 2.5)):
        T = from_yaw(k, 0, 0, yaw)
        graph.add(T, askew[2, :3])
        if k:
            graph.connect(k - 1, k, T, SURE, ConstraintKind.MOTION)
    before = graph.poses.copy()
    graph.optimise()
    np.testing.assert_allclose(graph.poses, before, atol=1e-4)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_nothing_moves_where_all_agree(x: float, yaw: float) -> None:
    graph = chain([from_yaw(x, 0.1, 0, yaw), from_yaw(0, x, 0, -yaw)])
    graph.connect(0, 2, graph.poses[2], SURE, ConstraintKind.LOOP)
    before = graph.poses.copy()
    graph.optimise()
    np.testing.assert_allclose(graph.poses, before, atol=1e-6)


def test_a_constraint_is_relative_to_where_its_keyframe_is_believed_to_be() -> None:
    graph = chain([from_yaw(1, 0, 0, 0)])
    start = from_yaw(0, 5, 0, np.pi / 2)
    other = PoseGraph(CONFIG)
    other.add(start, UP)
    other.connect(
        0, other.add(start @ from_yaw(1.5, 0, 0, 0), UP), start @ from_yaw(1, 0, 0, 0), SURE, ConstraintKind.MOTION
    )
    other.optimise()
    np.testing.assert_allclose(inverse(other.poses[0]) @ other.poses[1], graph.poses[1], atol=1e-4)


def test_the_error_of_a_keyframe_has_the_lever_of_its_distance() -> None:
    """A heading that is unsure by 0.01 rad at the second keyframe moves the first by 0.01 rad times 8 m."""
    graph = PoseGraph(CONFIG)
    for x in (0.0, 4.0, 8.0):
        graph.add(from_yaw(x, 0, 0, 0), UP)
    sure, turn = 1e8 * np.eye(6), 1e8 * np.eye(6)
    turn[2, 2] = 0.01**-2
    graph.connect(0, 1, graph.poses[1], turn, ConstraintKind.MOTION)
    graph.connect(1, 2, graph.poses[2], sure, ConstraintKind.MOTION)
    graph.optimise()
    errors = graph.relative_samples(2)
    assert np.std(errors[1]) < 0.001
    assert np.std(errors[0, 4]) == pytest.approx(0.04, rel=0.3)  # at keyframe 2, 4 m from where the error arose
    assert np.std(errors[0, 2]) == pytest.approx(0.01, rel=0.3)
    assert graph.deviations(2)[0] == pytest.approx(np.hypot(0.04, 0.02), rel=0.3)


def test_a_keyframe_that_sees_what_an_old_one_saw_stays_certain_relative_to_it() -> None:
    """20 motions of 0.1 m, each unsure by 0.03 m; every keyframe but the first also sees what the first one saw."""
    motion, surface = np.diag([1e6] * 3 + [0.03**-2] * 3), np.diag([1e6] * 3 + [0.01**-2] * 3)
    blind, sees = PoseGraph(CONFIG), PoseGraph(CONFIG)
    for graph, seen in ((blind, ()), (sees, ((0, surface),))):
        graph.add(np.eye(4), UP)
        for k in range(20):
            graph.connect(
                k, graph.add(from_yaw(0.1 * (k + 1), 0, 0, 0), UP), graph.poses[-1], motion, ConstraintKind.MOTION
            )
            for i, information in seen:
                graph.connect(i, k + 1, graph.poses[-1], information, ConstraintKind.SURFACE)
            graph.extend_samples(k, motion)
    assert blind.deviations(20)[0] == pytest.approx(0.03 * np.sqrt(3 * 20), rel=0.3)
    (found,) = sees.deviations(20)[:1]
    assert found == pytest.approx(0.01 * np.sqrt(3), rel=0.3)
    sees.optimise()
    assert found == pytest.approx(sees.deviations(20)[0], rel=0.3)


def test_roll_and_pitch_stay_as_certain_as_gravity_in_a_blind_drive() -> None:
    sigma = CONFIG.odometry.gravity_sigma
    graph, motion = PoseGraph(CONFIG), np.diag(np.repeat([sigma, 0.03], 3) ** -2.0)
    graph.add(np.eye(4), UP)
    for k in range(30):
        graph.add(graph.poses[-1] @ from_yaw(0.3, 0, 0, 0), UP)
        graph.extend_samples(k, motion)
    roll, pitch, heading = np.sqrt(np.mean(np.square(graph.relative_samples(0)[30, :3]), axis=1))
    assert max(roll, pitch) < 1.2 * sigma
    assert heading == pytest.approx(sigma * np.sqrt(30), rel=0.3)


@given(st.integers(1, 5))
@settings(max_examples=5, deadline=None)
def test_samples_are_as_uncertain_as_the_inverse_of_the_information(seed: int) -> None:
    """The covariance by samples, against that of GTSAM's marginals of the same graph."""
    rng, graph, factors, values = np.random.default_rng(seed), PoseGraph(CONFIG), *gtsam_of()
    for k in range(6):
        T = from_yaw(*rng.uniform(-2, 2, 2), 0, rng.uniform(-1, 1))
        graph.add(T, T[2, :3])
        values.insert(k, gtsam.Pose3(T))
        factors.add(gtsam.AttitudeFactorPose3(k, gtsam.Unit3(UP), GRAVITY, gtsam.Unit3(T[2, :3])))
        for i in range(k):
            information = np.diag(rng.uniform(1e2, 1e4, 6))
            graph.connect(i, k, T, information, ConstraintKind.SURFACE)
            model = gtsam.noiseModel.Gaussian.Information(information)
            factors.add(gtsam.BetweenFactorPose3(i, k, gtsam.Pose3(inverse(graph.poses[i]) @ T), model))
    graph.optimise()
    expected = gtsam.Marginals(factors, values).marginalCovariance(5)
    found = graph.covariance(5)
    level = slice(2, 6)  # roll and pitch of the first keyframe are uncertain, too, of which GTSAM knows nothing here
    ratio = np.linalg.solve(expected[level, level], found[level, level])
    assert np.trace(ratio) / 4 == pytest.approx(1.0, abs=0.3)


GRAVITY = gtsam.noiseModel.Isotropic.Sigma(2, CONFIG.odometry.gravity_sigma)


def gtsam_of() -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """An empty graph of GTSAM, and its first keyframe's prior."""
    factors, sigmas = gtsam.NonlinearFactorGraph(), np.full(6, CONFIG.graph.fixed_sigma)
    sigmas[:2] = 1.0
    factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(), gtsam.noiseModel.Diagonal.Sigmas(sigmas)))
    return factors, gtsam.Values()


def test_the_best_poses_are_those_of_gtsam() -> None:
    """A chain with a loop that contradicts it, solved by Levenberg-Marquardt with the same loss."""
    rng, graph, factors, values = np.random.default_rng(0), PoseGraph(CONFIG), *gtsam_of()
    loss = gtsam.noiseModel.mEstimator.GemanMcClure.Create(np.sqrt(chi2_gate(6, CONFIG.registration.confidence)))

    def connect(i: int, j: int, T: NDArray[np.float64], information: NDArray[np.float64]) -> None:
        graph.connect(i, j, T, information, ConstraintKind.SURFACE)
        model = gtsam.noiseModel.Robust.Create(loss, gtsam.noiseModel.Gaussian.Information(information))
        factors.add(gtsam.BetweenFactorPose3(i, j, gtsam.Pose3(inverse(graph.poses[i]) @ T), model))

    for k in range(9):
        T = graph.poses[-1] @ from_yaw(0.5, 0, 0, 0.7) if k else np.eye(4)
        graph.add(T, UP)
        values.insert(k, gtsam.Pose3(T))
        factors.add(gtsam.AttitudeFactorPose3(k, gtsam.Unit3(UP), GRAVITY, gtsam.Unit3(UP)))
        if k:
            connect(k - 1, k, T, np.diag([1e5, 1e5, 1e4, 1e3, 1e3, 1e3]))
    for i, j in ((0, 8), (1, 7), (2, 6)):
        T = graph.poses[j] @ from_yaw(*rng.normal(0, 0.03, 2), 0, rng.normal(0, 0.02))
        connect(i, j, T, np.diag([1e5, 1e5, 1e4, 1e3, 1e3, 1e3]))
    graph.optimise()
    best = gtsam.LevenbergMarquardtOptimizer(factors, values).optimize()
    for k, T in enumerate(graph.poses):
        np.testing.assert_allclose(T, best.atPose3(k).matrix(), atol=1e-3)


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_a_constraint_that_says_nothing_costs_itself_alone(value: float) -> None:
    graph = chain([from_yaw(1, 0, 0, 0)] * 2)
    graph.connect(0, 2, graph.poses[2], np.full((6, 6), value), ConstraintKind.SURFACE)
    graph.optimise()
    assert graph.dropped == (not np.isfinite(value))
    np.testing.assert_allclose(graph.poses[:, 0, 3], [0, 1, 2], atol=1e-6)


def test_old_poses_stay_until_the_graph_has_grown() -> None:
    """A long chain, solved keyframe by keyframe, ends where solving it at once puts it."""
    config = replace(CONFIG, graph=replace(CONFIG.graph, window=3))
    bit_by_bit, at_once = PoseGraph(config), PoseGraph(CONFIG)
    for graph in (bit_by_bit, at_once):
        graph.add(np.eye(4), UP)
        for k in range(1, 20):
            graph.add(graph.poses[-1] @ from_yaw(0.5, 0, 0, 0.1), UP)
            graph.connect(k - 1, k, graph.poses[k], SURE, ConstraintKind.MOTION)
            if k > 1:
                graph.connect(
                    k - 2, k, graph.poses[k - 2] @ from_yaw(0.99, 0.05, 0, 0.2), SURE, ConstraintKind.SURFACE
                )
            if graph is bit_by_bit:
                graph.optimise()
        graph.is_unsettled = True
        graph.optimise()
    np.testing.assert_allclose(bit_by_bit.poses, at_once.poses, atol=1e-3)


def test_one_keyframe_is_known() -> None:
    graph = chain([])
    graph.optimise()
    np.testing.assert_allclose(graph.poses, [np.eye(4)], atol=1e-9)


def driven(motions: list[MeasuredMotion]) -> PoseGraph:
    """A graph of keyframes at the poses by the odometry, connected by it alone."""
    graph = PoseGraph(CONFIG)
    graph.add(np.eye(4), UP)
    for motion in motions:
        graph.add(graph.poses[-1] @ motion.T, UP)
        graph.add_motion(motion)
    return graph


def test_a_turn_that_closes_shows_what_is_wrong_with_the_gyro() -> None:
    """24 steps of 15° by a gyro that measures 0.7% too much; a loop joins the last keyframe to the first."""
    step, true = np.pi / 12, np.pi / 12 * (1 - 0.007)
    graph = driven([MeasuredMotion(from_yaw(0, 0, 0, step), UP, 1.0)] * 24)
    graph.connect(0, 24, from_yaw(0, 0, 0, 24 * true), 1e6 * np.eye(6), ConstraintKind.MOTION)
    graph.optimise()
    assert graph.odometry.errors[1] == pytest.approx(-0.007, abs=0.0003)
    headings = np.unwrap([yaw_of(T) for T in graph.poses])
    np.testing.assert_allclose(headings, true * np.arange(25), atol=0.001)


def test_a_return_shows_the_tyres_radius_and_every_motion_follows() -> None:
    """30 m ahead, measured 2% too short, the robot meets a place that it knows."""
    graph = driven([MeasuredMotion(from_yaw(0.3 / 1.02, 0, 0, 0), UP, 1.0)] * 100)
    graph.optimise()
    assert graph.odometry.errors[0] == pytest.approx(0, abs=1e-6)
    unsure = graph.odometry.covariance[0, 0]
    graph.connect(0, 100, from_yaw(30, 0, 0, 0), 1e6 * np.eye(6), ConstraintKind.MOTION)
    graph.optimise()
    assert graph.odometry.errors[0] == pytest.approx(0.02, abs=0.001)
    assert graph.odometry.covariance[0, 0] < unsure / 10
    np.testing.assert_allclose(graph.poses[:, 0, 3], 0.3 * np.arange(101), atol=0.02)


def test_a_pose_is_stated_as_sure_as_its_drive() -> None:
    """Errors of single motions grow with the root of the way, those of the tyres with the way."""
    motion = MeasuredMotion(from_yaw(0.3, 0, 0, 0), UP, 1.0)
    graph = driven([motion] * 50)
    graph.optimise()
    deviation = np.sqrt(graph.covariance(50)[3, 3])
    assert deviation == pytest.approx(np.sqrt(50 * motion.noise(CONFIG.odometry)[3, 3] + (0.02 * 15) ** 2), rel=0.3)


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_the_same_poses_are_found_from_far_away(seed: int) -> None:
    """Each keyframe begins metres and up to 86° off, from where a whole Gauss-Newton step may lead astray."""
    rng = np.random.default_rng(seed)
    graph = driven([MeasuredMotion(from_yaw(0.5, 0, 0, 0.3), UP, 1.0)] * 20)
    graph.connect(0, 20, graph.poses[20] @ from_yaw(0.1, 0.05, 0, 0.02), SURE, ConstraintKind.MOTION)
    graph.optimise()
    near, odometry = graph.poses.copy(), graph.odometry
    for k in range(1, 21):
        graph.poses[k] = graph.poses[k] @ from_yaw(*rng.uniform(-8, 8, 2), 0, rng.uniform(-1.5, 1.5))
    graph.is_unsettled = True
    graph.optimise()
    np.testing.assert_allclose(graph.poses, near, atol=1e-3)
    np.testing.assert_allclose(graph.odometry.errors, odometry.errors, atol=1e-3)


def test_poses_that_somebody_keeps_stay_when_the_graph_is_solved() -> None:
    graph = chain([from_yaw(1.1, 0, 0, 0)] * 3, VAGUE)
    graph.connect(0, 3, from_yaw(3, 0, 0, 0), 1e3 * np.eye(6), ConstraintKind.LOOP)
    kept = graph.poses
    before = kept.copy()
    graph.optimise()
    assert not np.array_equal(graph.poses, before)
    np.testing.assert_array_equal(kept, before)
