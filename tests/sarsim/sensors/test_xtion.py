"""The sensor's errors, one at a time, on pictures whose true depth is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from sarsim.sensors import xtion
from sarsim.sensors import xtion_kernels as kernels
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.xtion import Xtion

INTRINSICS = Intrinsics(320, 240, 580.0, 580.0, 160.0, 120.0)
NO_ERROR = Xtion.ideal(min_range=0.0, max_range=100.0)
FOCAL_BASELINE = 580.0 * 0.075


def plane(distance: float, tilt: float = 0.0, intrinsics: Intrinsics = INTRINSICS) -> NDArray[np.float32]:
    """(H, W) float32 depth of a plane ``distance`` m ahead, turned by ``tilt`` rad about y; 0 past its horizon."""
    x = intrinsics.rays[..., 0].astype(np.float64)
    inverse_depth = (1 - x * np.tan(tilt)) / distance
    return np.where(inverse_depth > 0, 1 / inverse_depth, 0).astype(np.float32)


def step(near: float, far: float, column: int) -> NDArray[np.float32]:
    """(H, W) float32 depth: a far wall, and a near one from ``column`` on to the right."""
    depth = np.full((240, 320), far, np.float32)
    depth[:, column:] = near
    return depth


def measure(
    sensor: Xtion, depth: NDArray[np.float32], seed: int = 0
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    return sensor.measure(depth, INTRINSICS, np.random.default_rng(seed))


def splitmix64(state: int) -> tuple[int, int]:
    """The published generator, in Python's own integers: next state and number."""
    mask = (1 << 64) - 1
    state = (state + 0x9E3779B97F4A7C15) & mask
    z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return state, z ^ (z >> 31)


def test_random_bits_are_splitmix64() -> None:
    state = 2**63 + 12345
    bits = kernels.random_bits(np.uint64(state), 3, 5)
    for value in bits.ravel():
        state, expected = splitmix64(state)
        assert int(value) == expected


@given(a=st.floats(-0.05, 0.05), b=st.floats(-0.05, 0.05))
def test_slopes_of_a_plane_are_exact(a: float, b: float) -> None:
    v, u = np.mgrid[0:12, 0:16]
    per_column, per_row = kernels.slopes((20 + a * u + b * v).astype(np.float32))
    np.testing.assert_allclose(per_column, a, atol=1e-5)
    np.testing.assert_allclose(per_row, b, atol=1e-5)


def test_slopes_beside_an_edge_are_those_of_the_surface() -> None:
    values = np.tile(np.array([1, 2, 3, 53, 55, 57], np.float32), (4, 1))
    per_column, per_row = kernels.slopes(values)
    np.testing.assert_array_equal(per_column[0], [1, 1, 1, 2, 2, 2])
    np.testing.assert_array_equal(per_row, 0)


@pytest.mark.parametrize("tilt", [0, 20, 45, 60, 75, 85])
def test_incidence_of_a_tilted_plane(tilt: float) -> None:
    depth = plane(1.5, np.radians(tilt))
    disparity = np.divide(FOCAL_BASELINE, depth, out=np.zeros_like(depth), where=depth > 0)
    rays = INTRINSICS.rays
    cosine = kernels.cosine_of_incidence(disparity, *kernels.slopes(disparity), rays, 580.0, 580.0)
    normal = np.array([-np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
    expected = rays @ normal / np.linalg.norm(rays, axis=-1)
    inner = (depth > 0) & (depth < 50)
    np.testing.assert_allclose(cosine[inner], expected[inner], atol=2e-3)


def test_ideal_only_cuts_at_the_range() -> None:
    depth = plane(1.6, np.radians(75))
    measured, source = measure(Xtion.ideal(), depth)
    within = (depth >= 0.8) & (depth <= 3.5)
    assert 0.2 < within.mean() < 0.9
    np.testing.assert_array_equal(measured, np.where(within, depth, 0))
    np.testing.assert_array_equal(source.ravel(), np.arange(depth.size))


@pytest.mark.parametrize(("distance", "tilt"), [(1.0, 0), (3.0, 0), (2.0, 50), (2.0, 78)])
def test_axial_noise_has_the_published_spread(distance: float, tilt: float) -> None:
    depth = plane(distance, np.radians(tilt))
    measured, _ = measure(replace(NO_ERROR, axial_noise=True), depth)
    middle = np.s_[:, 155:165]  # there the incidence is the tilt and the depth the distance
    error = (measured - depth)[middle]
    angle = np.radians(tilt)
    sigma = 0.0012 + 0.0019 * (distance - 0.4) ** 2
    if tilt > 60:
        sigma += 0.0001 / np.sqrt(distance) * angle**2 / (np.pi / 2 - angle) ** 2
    assert error.std() == pytest.approx(sigma, rel=0.06)
    assert abs(error.mean()) < 4 * sigma / np.sqrt(error.size)


def test_quantisation_rounds_disparity_to_eighths() -> None:
    depth = plane(2.5, np.radians(30))
    measured, _ = measure(replace(NO_ERROR, quantisation=True), depth)
    steps = 8 * FOCAL_BASELINE / measured
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert (np.abs(FOCAL_BASELINE / depth - FOCAL_BASELINE / measured) <= 1 / 16 + 1e-5).all()


def test_projector_shadow_is_what_the_projector_cannot_see() -> None:
    disparity = np.random.default_rng(3).uniform(5, 40, (20, 60)).astype(np.float32)
    shadow = kernels.projector_shadow(disparity)
    for v, u in np.ndindex(*disparity.shape):
        columns = np.arange(60) - disparity[v]
        assert shadow[v, u] == (columns[u + 1 :] <= columns[u]).any()


def test_projector_shadow_needs_an_edge() -> None:
    for tilt in (-70, 0, 70):
        depth = plane(1.5, np.radians(tilt))
        measured, _ = measure(replace(NO_ERROR, shadow=True), depth)
        np.testing.assert_array_equal(measured, depth)


def test_grazing_surfaces_do_not_return(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xtion, "MAX_INCIDENCE", 70.0)
    sensor = replace(NO_ERROR, grazing=True)
    rays = INTRINSICS.rays
    depth = plane(1.5, np.radians(65))
    normal = np.array([-np.sin(np.radians(65)), 0, np.cos(np.radians(65))])
    incidence = np.degrees(np.arccos(rays @ normal / np.linalg.norm(rays, axis=-1)))
    measured, _ = measure(sensor, depth)
    assert (measured[incidence > 70.1] == 0).all()
    assert (measured[incidence < 69.9] > 0).all()
    assert (incidence > 70.1).any()


def test_lateral_noise_leaves_planes_alone() -> None:
    for tilt in (0, 40, 70):
        _, source = measure(replace(NO_ERROR, lateral_noise=True), plane(2.0, np.radians(tilt)))
        np.testing.assert_array_equal(source.ravel(), np.arange(source.size))


def test_lateral_noise_frays_edges_by_its_sigma() -> None:
    depth = step(1.0, 2.0, 160)
    measured, source = measure(replace(NO_ERROR, lateral_noise=True), depth)
    np.testing.assert_array_equal(measured, depth.ravel()[source])
    changed = measured != depth
    assert not changed[:, :156].any()
    assert not changed[:, 164:].any()
    # The column left of the edge measures beyond the edge if its offset rounds to 1 or more: P(N > 0.5 / 0.8).
    assert changed[:, 159].mean() == pytest.approx(0.266, abs=0.08)
    assert changed[:, 160].mean() == pytest.approx(0.266, abs=0.08)
    assert changed[:, 158].mean() == pytest.approx(0.030, abs=0.04)


def test_dropout_takes_its_share() -> None:
    measured, _ = measure(replace(NO_ERROR, dropout=0.2), plane(2.0))
    assert (measured == 0).mean() == pytest.approx(0.2, abs=0.01)


def labelled(depth: NDArray[np.float32]) -> LabelledImage:
    """An image with different labels and instances for near and far depths."""
    near = depth < 1.5
    return LabelledImage(
        rgb=np.zeros((240, 320, 3), np.uint8),
        depth=depth,
        label=np.where(near, 6, 1).astype(np.uint8),
        instance=np.where(near, 11, 7).astype(np.int32),
        intrinsics=INTRINSICS,
        T_world_camera=np.eye(4),
        T_base_camera=np.eye(4),
    )


def test_a_point_keeps_the_label_of_the_surface_it_comes_from() -> None:
    depth = step(1.0, 2.0, 160)
    depth[:, 220:] = 2.0
    image = labelled(depth)
    noisy = Xtion().apply(image, np.random.default_rng(1))
    near, far = np.abs(noisy.depth - 1.0) < 0.2, np.abs(noisy.depth - 2.0) < 0.2
    assert near[:, 220:].any()  # frayed outwards
    assert far[:, 160:220].any()  # and inwards
    assert (noisy.label[near] == 6).all()
    assert (noisy.instance[near] == 11).all()
    assert (noisy.label[far] == 1).all()
    assert (noisy.instance[far] == 7).all()
    np.testing.assert_array_equal(noisy.rgb, image.rgb)


def test_the_same_seed_gives_the_same_picture() -> None:
    depth = step(1.0, 2.0, 160)
    first, again, other = (measure(Xtion(), depth, seed)[0] for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5


@pytest.mark.parametrize("sensor", [Xtion(), Xtion.ideal(), Xtion(dropout=0.1, shadow=False)])
def test_switches_do_not_change_what_is_drawn_from_the_generator(sensor: Xtion) -> None:
    rng, reference = np.random.default_rng(8), np.random.default_rng(8)
    sensor.measure(plane(2.0), INTRINSICS, rng)
    NO_ERROR.measure(plane(2.0), INTRINSICS, reference)
    assert rng.integers(1 << 62) == reference.integers(1 << 62)


@settings(deadline=None, max_examples=40)
@given(
    depth=arrays(
        np.float32, (12, 16), elements=st.one_of(st.just(0.0), st.floats(0.015625, 50, width=32)), fill=st.just(2.0)
    ),
    seed=st.integers(0, 2**32),
)
def test_any_picture_gives_finite_depths_in_range(depth: NDArray[np.float32], seed: int) -> None:
    small = Intrinsics(16, 12, 29.0, 29.0, 8.0, 6.0)
    measured, source = Xtion().measure(depth, small, np.random.default_rng(seed))
    assert measured.dtype == np.float32
    assert ((measured == 0) | ((measured >= 0.8) & (measured <= 3.5))).all()
    assert (depth.ravel()[source][measured > 0] > 0).all()
