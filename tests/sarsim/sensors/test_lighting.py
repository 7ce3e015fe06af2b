"""Lighting, the lamp, and the colour sensor's noise in too little light."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.frame import Frame, Intrinsics
from sarsim.arenas.load import load_arena
from sarsim.sensors import conditions
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.conditions import FULL_WELL, MAX_GAIN, READ_NOISE, exposure_gain
from sarsim.sensors.lighting import BEAM_EXPONENT, Lighting, radiance
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

LEVELS = [light.name for light in Lighting]


def picture(depth: float = 2.0, value: int = 128) -> LabelledImage:
    shape = (240, 320)
    return LabelledImage(
        rgb=np.full((*shape, 3), value, np.uint8),
        depth=np.full(shape, depth, np.float32),
        label=np.ones(shape, np.uint8),
        instance=np.ones(shape, np.int32),
        intrinsics=Intrinsics(320, 240, 290.0, 290.0, 160.0, 120.0),
        T_world_camera=np.eye(4),
        T_base_camera=np.eye(4),
    )


@pytest.fixture(scope="module")
def looks() -> dict[str, Frame]:
    """The first frame in nist_6x4 under each lighting."""
    frames = {}
    for name in LEVELS:
        robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(lighting=name), seed=3)
        frames[name] = robot.sense()
        robot.close()
    return frames


@pytest.mark.parametrize("name", ["dim", "dark"])
def test_depth_is_the_same_in_the_dark_bit_for_bit(looks: dict[str, Frame], name: str) -> None:
    assert np.mean(looks["normal"].depth > 0) > 0.3
    np.testing.assert_array_equal(looks[name].depth, looks["normal"].depth)
    np.testing.assert_array_equal(looks[name].label, looks["normal"].label)


def test_pictures_fail_where_light_is_short(looks: dict[str, Frame]) -> None:
    """Images have grain, in dim light everywhere, in the lamp's light far from the lamp."""

    def grain(frame: Frame, chosen: NDArray[np.bool_]) -> float:
        green = frame.rgb[..., 1].astype(np.float64)
        return float(np.median(np.abs(np.diff(green, axis=1))[chosen[:, 1:]]) / green[chosen].mean())

    depth = looks["normal"].depth
    near, far = (depth > 0) & (depth < 1.5), depth > 2.5
    assert looks["dim"].rgb.mean() < 0.6 * looks["normal"].rgb.mean()
    for chosen in near, far:
        assert grain(looks["dim"], chosen) > 5 * grain(looks["normal"], chosen)
    assert grain(looks["dark"], near) < 3 * grain(looks["normal"], near)
    assert grain(looks["dark"], far) > 4 * grain(looks["normal"], far)


def test_the_lamp_lights_what_is_near_and_before_it() -> None:
    near, far = (radiance(picture(depth), Lighting.dark) for depth in (1.0, 2.0))
    np.testing.assert_allclose(near, 4 * far, rtol=1e-5)
    middle = Lighting.dark.value.lamp * 128 / 255
    np.testing.assert_allclose(near[120, 160], middle, rtol=1e-3)
    ray = picture().intrinsics.rays[0, 0]
    stretch = np.linalg.norm(ray)
    np.testing.assert_allclose(near[0, 0], middle * stretch ** -(BEAM_EXPONENT + 2), rtol=1e-3)
    assert np.all(radiance(picture(0.0), Lighting.dark) == 0)


def test_arena_light_is_what_is_rendered_but_for_its_share() -> None:
    np.testing.assert_allclose(radiance(picture(), Lighting.normal), 128 / 255, rtol=1e-6)
    light = Lighting.dim.value
    rendered = picture(value=round(128 * light.rendered))
    np.testing.assert_allclose(radiance(rendered, Lighting.dim), 128 / 255 * light.arena, rtol=0.02)


@pytest.mark.parametrize("level", [0.5, 0.05, 0.01])
def test_noise_is_that_of_photons_and_of_reading(level: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "TARGET_MEAN", 0.5)
    flat = np.full((240, 320, 3), level, np.float32)
    values = conditions.expose(flat, np.random.default_rng(0)).astype(np.float64)
    gain = min(0.5 / level, 8)
    electrons = level * FULL_WELL
    sigma = 255 * gain / FULL_WELL * np.sqrt(electrons + READ_NOISE**2)
    assert exposure_gain(flat) == pytest.approx(gain, rel=1e-5)
    assert values.mean() == pytest.approx(255 * gain * level, abs=0.3)
    assert values.std() == pytest.approx(np.hypot(sigma, np.sqrt(1 / 12)), rel=0.03)
    assert abs(np.corrcoef(values[..., 0].ravel(), values[..., 1].ravel())[0, 1]) < 0.02


def test_gain_never_dims_and_never_passes_its_limit() -> None:
    assert exposure_gain(np.ones((4, 4, 3), np.float32)) == 1
    assert exposure_gain(np.zeros((4, 4, 3), np.float32)) == MAX_GAIN


def test_white_saturates_and_black_stays_dark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conditions, "READ_NOISE", 0.0)
    values = conditions.expose(
        np.stack([np.full((8, 8), v, np.float32) for v in (2, 1.5, 0)], axis=-1), np.random.default_rng(0)
    )
    assert np.all(values[..., :2] == 255) and np.all(values[..., 2] == 0)


def test_the_same_seed_gives_the_same_grain() -> None:
    flat = np.full((16, 16, 3), 0.3, np.float32)
    first, second, other = (conditions.expose(flat, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, second)
    assert np.any(first != other)
