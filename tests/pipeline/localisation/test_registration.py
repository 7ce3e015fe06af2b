"""Registration recovers what surfaces determine, and leaves the rest to the priors."""

import numpy as np
import pytest
import small_gicp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.registration import (
    Prior,
    Target,
    cloud_of,
    evidence_by_keyframe,
    exponential,
    front_normals,
    logarithm,
    register,
)
from pipeline.transforms import from_yaw, inverse
from tests.pipeline.worlds import flat, ground_points, wall_points

CONFIG = RegistrationConfig()
VAGUE = 1e-3 * np.eye(6)
FLOOR = ground_points(flat, (-1, 1), (-1, 1))
ENDS = [wall_points((x, -1), (x, 1)) for x in (-1, 1)]
SIDES = [wall_points((-1, y), (1, y)) for y in (-1, 1)]


def is_pinned(information: NDArray[np.float64]) -> bool:
    """Whether an information determines the position to 0.1 m in every direction."""
    covariance = np.linalg.inv(information + np.eye(6))[3:, 3:]
    return bool(np.linalg.eigvalsh(covariance)[-1] < 0.1**2)


def scattered(*clouds: NDArray[np.float32], seed: int) -> NDArray[np.float64]:
    """A random third of the points of some clouds, with noise: no two frames have the same points."""
    rng, points = np.random.default_rng(seed), np.vstack(clouds)
    chosen = points[rng.random(len(points)) < 1 / 3]
    return chosen + rng.normal(0, 0.003, chosen.shape)


def target_of(*parts: NDArray[np.float64]) -> Target:
    """A target with a different owner for each part."""
    thin = [cloud_of(part, CONFIG) for part in parts]
    points = np.vstack([cloud.points()[:, :3] for cloud in thin])
    normals = np.vstack([cloud.normals()[:, :3] for cloud in thin])
    return Target(points, normals, np.repeat(np.arange(len(parts)), [cloud.size() for cloud in thin]))


def source_of(points: NDArray[np.float64], T_map_base: NDArray[np.float64]) -> small_gicp.PointCloud:
    """What a robot sees of points in ``map``."""
    T = inverse(T_map_base)
    return cloud_of(points @ T[:3, :3].T + T[:3, 3], CONFIG)


ROOM = target_of(scattered(FLOOR, *ENDS, *SIDES, seed=0))
CORRIDOR = target_of(scattered(*(p + np.array([x, 0, 0]) for p in (FLOOR, *SIDES) for x in (-2, 0, 2)), seed=0))
FAR = target_of(scattered(FLOOR, seed=0) + 100)

offsets = st.tuples(*[st.floats(-0.04, 0.04)] * 3, *[st.floats(-0.08, 0.08)] * 3).map(np.array)


@given(offset=offsets)
@settings(max_examples=8, deadline=None)
def test_a_known_pose_is_recovered_to_millimetres(offset: NDArray[np.float64]) -> None:
    true = from_yaw(0.3, -0.2, 0.1, 0.7)
    source = source_of(scattered(FLOOR, *ENDS, *SIDES, seed=1), true)
    found = register(ROOM, source, [Prior(true @ exponential(offset), VAGUE)], 0.2, CONFIG)
    error = logarithm(inverse(true) @ found.T)
    assert np.linalg.norm(error[3:]) < 0.002
    assert np.linalg.norm(error[:3]) < 0.002
    assert found.overlap > 0.99
    assert is_pinned(found.information)


@pytest.mark.parametrize("x", [0.0, 0.04, -0.3])
def test_along_a_corridor_the_pose_stays_with_the_prior(x: float) -> None:
    source = source_of(scattered(FLOOR, *SIDES, seed=1), np.eye(4))
    odometry = Prior(from_yaw(x, 0.06, 0.0, 0.04), np.diag(np.repeat([0.02, 0.02], 3) ** -2.0))
    found = register(CORRIDOR, source, [odometry], 0.2, CONFIG)
    assert found.T[0, 3] == pytest.approx(x, abs=0.01)
    assert np.abs(found.T[1:3, 3]).max() < 0.003
    assert np.abs(logarithm(found.T)[:3]).max() < 0.003


def test_of_the_direction_along_a_corridor_registration_claims_nothing() -> None:
    source = source_of(scattered(FLOOR, *SIDES, seed=1), np.eye(4))
    (evidence,), _ = evidence_by_keyframe(CORRIDOR, source, np.eye(4), CONFIG)
    along, across, up = np.diag(evidence.information)[3:]
    assert along < 1e-3 * min(across, up)
    assert not is_pinned(evidence.information)
    ends = source_of(scattered(FLOOR, *ENDS, *SIDES, seed=1), np.eye(4))
    assert is_pinned(evidence_by_keyframe(ROOM, ends, np.eye(4), CONFIG)[0][0].information)


@given(ratio=st.floats(0.01, 100), way=st.floats(-1, 1))
@settings(max_examples=10, deadline=None)
def test_priors_weigh_by_their_information(ratio: float, way: float) -> None:
    """Without corresponding points, the pose is the weighted mean of the priors."""
    priors = [Prior(np.eye(4), 9 * np.eye(6)), Prior(from_yaw(way, 0, 0, 0), 9 * ratio * np.eye(6))]
    found = register(FAR, source_of(scattered(FLOOR, seed=1), np.eye(4)), priors, 0.2, CONFIG)
    share = ratio / (1 + ratio)
    np.testing.assert_allclose(found.T, from_yaw(share * way, 0, 0, 0), atol=1e-9)
    np.testing.assert_allclose(found.covariance, np.eye(6) / (9 * (1 + ratio)), rtol=1e-9, atol=1e-12)
    assert found.chi2 == pytest.approx(9 * share * way**2, abs=1e-9)
    assert found.overlap == 0
    assert not found.information.any()


def test_a_sure_prior_holds_against_surfaces_and_chi2_shows_the_quarrel() -> None:
    source = source_of(scattered(FLOOR, *ENDS, *SIDES, seed=1), np.eye(4))
    off = from_yaw(0.05, 0, 0, 0)
    sure, vague = (register(ROOM, source, [Prior(off, i * np.eye(6))], 0.2, CONFIG) for i in (1e12, 1e2))
    assert sure.T[0, 3] == pytest.approx(0.05, abs=1e-4)
    assert vague.T[0, 3] == pytest.approx(0.0, abs=1e-3)
    assert vague.chi2 == pytest.approx(1e2 * 0.05**2, rel=0.1)


def test_each_owner_says_what_its_own_points_know() -> None:
    """The first keyframe owns the floor and the ends, the second the sides, 3 cm too far along y."""
    target = target_of(scattered(FLOOR, *ENDS, seed=0), scattered(*SIDES, seed=2) + np.array([0, 0.03, 0]))
    source = source_of(scattered(FLOOR, *ENDS, *SIDES, seed=1), np.eye(4))
    evidence, _ = evidence_by_keyframe(target, source, np.eye(4), CONFIG)
    first, second = sorted(evidence, key=lambda one: one.owner)
    assert (first.owner, second.owner) == (0, 1)
    assert np.linalg.norm(first.T[:3, 3]) < 0.003
    assert second.T[1, 3] == pytest.approx(0.03, abs=0.003)
    assert first.information[3, 3] > 30 * second.information[3, 3]
    assert second.information[4, 4] > 30 * first.information[4, 4]
    assert evidence[0].information.trace() >= evidence[1].information.trace()


def test_points_are_new_where_the_target_has_none() -> None:
    beyond = wall_points((1.2, -1), (1.2, 1))
    source = source_of(scattered(FLOOR, *ENDS, *SIDES, beyond, seed=1), np.eye(4))
    _, new = evidence_by_keyframe(ROOM, source, np.eye(4), CONFIG)
    x = source.points()[:, 0]
    assert new[x > 1.15].all()
    assert new[x < 1.05].mean() < 0.02


@pytest.mark.parametrize("side", [-1, 1])
def test_normals_point_to_the_camera_that_saw_the_wall(side: int) -> None:
    cloud = cloud_of(scattered(wall_points((0, -1), (0, 1)), seed=0), CONFIG)
    normals = front_normals(cloud, np.array([side * 2.0, 0.0, 0.5]))
    assert np.median(normals[:, 0] * side) > 0.99
    assert (normals[:, 0] * side > 0).all()


@given(offset=offsets)
def test_the_exponential_undoes_the_logarithm(offset: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(logarithm(exponential(offset)), offset, atol=1e-12)


def test_points_of_less_weight_move_the_pose_less() -> None:
    """The robot sees two ends of a room, of which one has drifted by 4 cm."""
    near, far = ENDS
    drifted = scattered(far, seed=2) + np.array([0.04, 0.0, 0.0])
    places = []
    for weight in (1.0, 1e-4):
        room = target_of(scattered(FLOOR, *SIDES, near, seed=3), drifted)
        room.weight[room.owner == 1] = weight
        source = source_of(scattered(FLOOR, *ENDS, *SIDES, seed=1), np.eye(4))
        places.append(register(room, source, [Prior(np.eye(4), VAGUE)], 0.2, CONFIG).T[0, 3])
    assert places[0] > 0.01
    assert abs(places[1]) < 0.003
