"""Known depth cameras: which one a recording names, and what its flags say."""

import re

import pytest

from pipeline.datasets.depth_cameras import DEFAULT_SENSOR, KNOWN_CAMERAS, camera_named, stereo_noise, with_overrides
from pipeline.errors import InputError
from pipeline.sensor import XTION, DepthNoise


@pytest.mark.parametrize(
    ("name", "camera"),
    [
        ("rgbd_dataset_freiburg1_room", "Xtion"),
        ("openni_rgb_optical_frame", "Xtion"),
        ("/kinect2/qhd/image_depth_rect", "v2"),
        ("/k4a/depth_to_rgb/image_raw", "Azure"),
        ("Intel RealSense D455", "D455"),
        ("d415_depth_optical_frame", "D415"),
        ("front_d435i_link", "D435"),
        ("/device_0/sensor_0/Depth_0/image/data", "D435"),
    ],
)
def test_a_name_gives_the_camera(name: str, camera: str) -> None:
    found = camera_named(["camera_depth_optical_frame", "/camera/depth/image_raw", name])
    assert found is not None
    assert camera in found[0].name and found[1] == name


@pytest.mark.parametrize(
    "name",
    [
        "camera_optical",
        "/camera/depth/image_raw",
        "office_2024-05-01",
        "scene_d4",
        "recorded412",
        "world456",
        "fjord430",
    ],
)
def test_other_names_give_none(name: str) -> None:
    assert camera_named([name]) is None


def test_the_noise_of_stereo_is_that_of_its_disparity() -> None:
    # At 2 m, 400 pixels and 10 cm give a disparity of 20 pixels; 0.1 pixels less give 2.01005 m.
    camera = with_overrides(DEFAULT_SENSOR, depth_noise=stereo_noise(400, 0.1, 0.1).growth)
    assert camera.sigma(2.0) == pytest.approx(400 * 0.1 / (20 - 0.1) - 2, rel=0.01)


def test_every_camera_has_a_usable_range() -> None:
    for camera in KNOWN_CAMERAS:
        assert 0 < camera.sensor.nearest < camera.sensor.farthest - 2 * camera.sensor.margin
        assert 0 < camera.sensor.sigma(camera.sensor.farthest) < 0.06


def test_flags_replace_what_they_give_and_nothing_else() -> None:
    assert with_overrides(XTION) is XTION
    ranged = with_overrides(XTION, depth_range=(0.4, 6.0))
    assert (ranged.nearest, ranged.farthest, ranged.noise) == (0.4, 6.0, XTION.noise)
    noisy = with_overrides(XTION, depth_noise=0.004)
    assert (noisy.nearest, noisy.farthest, noisy.noise) == (XTION.nearest, XTION.farthest, DepthNoise(0.0, 0.004))
    assert noisy.margin == pytest.approx(5 * 0.004 * XTION.farthest**2)


@pytest.mark.parametrize(
    ("flags", "value"),
    [
        ({"depth_range": (0.0, 5.0)}, "--depth-range 0 5"),
        ({"depth_range": (5.0, 0.5)}, "--depth-range 5 0.5"),
        ({"depth_range": (0.5, 80.0)}, "--depth-range 0.5 80"),
        ({"depth_range": (0.5, float("nan"))}, "--depth-range 0.5 nan"),
        ({"depth_range": (3.0, 3.1)}, "3 to 3.1 m"),
        ({"depth_noise": 0.0}, "--depth-noise 0"),
        ({"depth_noise": -0.01}, "--depth-noise -0.01"),
        ({"depth_noise": float("nan")}, "--depth-noise nan"),
        ({"depth_noise": 5.0}, "--depth-noise 5"),
        ({"depth_range": (0.5, 8.0), "depth_noise": 0.05}, "0.5 to 8 m"),
    ],
)
def test_what_no_camera_measures_is_refused(flags: dict, value: str) -> None:
    with pytest.raises(InputError, match=re.escape(value)) as raised:
        with_overrides(DEFAULT_SENSOR, **flags)
    assert "\n" not in str(raised.value)
