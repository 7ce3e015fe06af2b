import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.frame import Intrinsics
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.thermal import MAX_TEMPERATURE, MIN_TEMPERATURE, NETD, THERMAL_SIZE, ThermalCamera


def image(instance):
    h, w = instance.shape
    blank = np.zeros((h, w), np.uint8)
    rgb, eye = np.zeros((h, w, 3), np.uint8), np.eye(4)
    return LabelledImage(
        rgb, np.ones((h, w), np.float32), blank, instance.astype(np.int32), Intrinsics(w, h, 1, 1, 1, 1), eye, eye
    )


def seen(instance, temperature, seed=0):
    return ThermalCamera(np.array(temperature, np.float32)).image(image(instance), np.random.default_rng(seed))


def test_a_pixel_has_the_mean_of_what_it_shows():
    """Geom 0 is warm and fills all but the lower half of one pixel in the corner; beside it is no geom."""
    instance = np.full((480, 640), -1)
    instance[:12, :8] = 0
    thermal = seen(instance, [34.0, 20.0])
    assert thermal.shape == THERMAL_SIZE[::-1] and thermal.dtype == np.float32
    assert_allclose(thermal[:3, 0], [34, 27, 20], atol=6 * NETD)
    assert_allclose(thermal[:, 1:], 20, atol=6 * NETD)


def test_the_noise_is_that_of_the_sensor():
    thermal = seen(np.zeros((480, 640)), [20.0, 20.0])
    assert_allclose(thermal.std(), NETD, rtol=0.05)
    assert_allclose(thermal.mean(), 20.0, atol=4 * NETD / np.sqrt(thermal.size))


def test_what_is_hotter_or_colder_than_the_range_saturates():
    instance = np.arange(2).repeat(320)[None].repeat(480, axis=0)
    thermal = seen(instance, [900.0, -60.0, 20.0])
    assert_array_equal(thermal[:, :40], np.float32(MAX_TEMPERATURE))
    assert_array_equal(thermal[:, 40:], np.float32(MIN_TEMPERATURE))


def test_the_same_generator_gives_the_same_image():
    instance = np.zeros((480, 640))
    assert_array_equal(seen(instance, [20.0, 20.0]), seen(instance, [20.0, 20.0]))
    assert not np.array_equal(seen(instance, [20.0, 20.0]), seen(instance, [20.0, 20.0], seed=1))
