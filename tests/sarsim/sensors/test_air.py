"""Dust: how many depth returns it takes and makes, and what it does to colours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from sarsim.sensors import air as air_module
from sarsim.sensors.air import DUST_COLOUR, Air
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.lighting import Lighting, distances, radiance

INTRINSICS = Intrinsics(320, 240, 290.0, 290.0, 160.0, 120.0)


def wall(depth: float, intrinsics: Intrinsics = INTRINSICS) -> LabelledImage:
    """A grey wall at right angles to the optical axis."""
    shape = (intrinsics.height, intrinsics.width)
    return LabelledImage(
        rgb=np.full((*shape, 3), 102, np.uint8),
        depth=np.full(shape, depth, np.float32),
        label=np.full(shape, 1, np.uint8),
        instance=np.full(shape, 9, np.int32),
        intrinsics=intrinsics,
        T_world_camera=np.eye(4),
        T_base_camera=np.eye(4),
    )


def thinned(
    air: Air, image: LabelledImage, seed: int = 0, min_range: float = 0.0, max_range: float = np.inf
) -> LabelledImage:
    return air.apply_to_depth(image, image, min_range, max_range, np.random.default_rng(seed))


@pytest.mark.parametrize(("dust", "depth"), [(0.2, 1.0), (0.5, 2.0), (1.0, 1.5)])
def test_returns_thin_by_beer_and_lamberts_law(dust: float, depth: float) -> None:
    air = Air(dust)
    image = wall(depth)
    result = thinned(air, image)
    passing = np.exp(-2 * air.extinction * distances(image).astype(np.float64))
    speck = dust * air_module.SPECK_RATE * (1 - passing)
    expected = (1 - speck) * passing
    kept = (result.depth == image.depth) & (result.instance == 9)
    sigma = np.sqrt(np.sum(expected * (1 - expected)))
    assert abs(kept.sum() - expected.sum()) < 4 * sigma
    specks = result.instance == -1
    assert abs(specks.sum() - speck.sum()) < 4 * np.sqrt(speck.sum())
    assert np.all(result.depth[~kept & ~specks] == 0)


def test_specks_lie_before_the_surface_by_the_same_law_and_have_no_label(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(air_module, "SPECK_RATE", 1.0)
    air = Air(1.0)
    image = wall(2.5)
    result = thinned(air, image)
    specks = result.instance == -1
    far = distances(image)[specks].astype(np.float64)
    near = distances(result)[specks].astype(np.float64)
    assert np.all(near < far) and np.all(result.label[specks] == 0)
    quantile = (1 - np.exp(-2 * air.extinction * near)) / (1 - np.exp(-2 * air.extinction * far))
    assert stats.kstest(quantile, "uniform").pvalue > 0.01


def test_specks_out_of_the_sensors_range_do_not_return(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(air_module, "SPECK_RATE", 1.0)
    result = thinned(Air(1.0), wall(2.5), min_range=0.8, max_range=1.6)
    specks = result.instance == -1
    assert 0.8 <= result.depth[specks].min() < result.depth[specks].max() <= 1.6
    assert np.all(result.depth[~specks & (result.depth != 2.5)] == 0)


def test_where_nothing_returns_dust_still_does() -> None:
    nothing = thinned(Air(0.6), wall(0.0))
    share = np.mean(nothing.depth > 0)
    assert abs(share - 0.6 * 0.05) < 4 * np.sqrt(0.03 / nothing.depth.size)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.01, 1), st.floats(0.01, 1), st.integers(0, 1000))
def test_what_comes_through_more_dust_comes_through_less(a: float, b: float, seed: int) -> None:
    image = wall(2.0, Intrinsics(64, 48, 60.0, 60.0, 32.0, 24.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(air_module, "SPECK_RATE", 0.0)
        less, more = (thinned(Air(dust), image, seed).depth > 0 for dust in sorted((a, b)))
    assert not np.any(more & ~less)


def test_the_same_seed_gives_the_same_dust() -> None:
    first, second, other = (thinned(Air(0.4), wall(2.0), seed).depth for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    assert np.any(first != other)


def test_clear_air_changes_nothing() -> None:
    image = wall(2.0)
    assert thinned(Air(0.0), image) is image
    light = radiance(image, Lighting.normal)
    assert Air(0.0).veil(light, image, Lighting.normal) is light


def test_colours_blend_to_grey_by_distance() -> None:
    """At the principal point, 2 m away, half of the densest dust passes e^(-0.25 * 2) of the light."""
    image = wall(2.0, Intrinsics(3, 3, 100.0, 100.0, 1.5, 1.5))
    seen = Air(0.5).veil(radiance(image, Lighting.normal), image, Lighting.normal)
    passing = np.exp(-0.5)
    np.testing.assert_allclose(seen[1, 1], 0.4 * passing + DUST_COLOUR * (1 - passing), rtol=1e-5)
    sky = Air(0.5).veil(radiance(wall(0.0), Lighting.normal), wall(0.0), Lighting.normal)
    np.testing.assert_allclose(sky, np.broadcast_to(DUST_COLOUR, sky.shape), rtol=1e-6)


def test_the_lamp_loses_twice_and_shines_back() -> None:
    image = wall(2.0, Intrinsics(3, 3, 100.0, 100.0, 1.5, 1.5))
    clear = radiance(image, Lighting.dark)
    seen = Air(0.5).veil(clear, image, Lighting.dark)[1, 1]
    veil = 0.5 * Lighting.dark.value.lamp * DUST_COLOUR * (1 - np.exp(-1.0))
    np.testing.assert_allclose(seen, clear[1, 1] * np.exp(-1.0) + veil, rtol=1e-5)


@pytest.mark.parametrize("dust", [-0.1, 1.1, float("nan"), float("inf")])
def test_dust_that_cannot_be_is_refused(dust: float) -> None:
    with pytest.raises(InputError, match="dust must be from 0 to 1, not "):
        Air(dust)
