"""A depth and a colour camera by their topics."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.datasets.cameras import (
    IMAGE_TYPES,
    INFO_TYPE,
    ImageSource,
    RgbdCamera,
    info_topic,
    is_rectified,
    registered,
)
from pipeline.datasets.links import FrameTree
from pipeline.datasets.pinhole import ImageRectifier
from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.plugins.ros import messages
from pipeline.transforms import from_rotation, from_yaw

DEPTH = Intrinsics(160, 120, 140.0, 142.0, 80.5, 60.5)
COLOUR = Intrinsics(320, 240, 390.0, 385.0, 158.5, 122.5)
SHELF = 1.0, 2.5
"""Depths, m, of a board in the middle of the view and of the wall behind."""


def seen_by(k: Intrinsics, T_board_camera: np.ndarray) -> np.ndarray:
    """(H, W) depth, m, of a board of 0.6 × 0.4 m before an endless wall, both at right angles to z."""
    rays = k.rays.astype(np.float64) @ T_board_camera[:3, :3].T
    origin, depth = T_board_camera[:3, 3], np.full((k.height, k.width), np.inf)
    for z, half in zip(SHELF, ((0.3, 0.2), (np.inf, np.inf)), strict=True):
        far = (z - origin[2]) / rays[..., 2]
        x, y = origin[0] + far * rays[..., 0], origin[1] + far * rays[..., 1]
        depth = np.where((np.abs(x) < half[0]) & (np.abs(y) < half[1]), np.minimum(depth, far), depth)
    return depth.astype(np.float32)


@pytest.mark.parametrize(
    "T",
    [
        from_rotation(np.eye(3), [0.05, 0.0, 0.01]),
        from_rotation(np.eye(3), [0, -0.04, 0]),
        from_yaw(0.02, 0.01, 0, 0.02),
    ],
    ids=["beside", "above", "turned"],
)
@pytest.mark.parametrize("target", [COLOUR, DEPTH, Intrinsics(80, 60, 75.0, 76.0, 40.0, 30.0)])
def test_registered_depth_is_what_the_other_camera_would_see(target: Intrinsics, T: np.ndarray) -> None:
    found = registered(seen_by(DEPTH, np.eye(4)), DEPTH, target, np.linalg.inv(T))
    true = seen_by(target, T)
    view = found > 0  # the views and what the board hides differ
    assert view.mean() > 0.75
    # Off by more than a little it may be at the board's edge alone.
    assert (np.abs(found - true)[view] < 0.01).mean() > 0.97
    board = np.zeros_like(view)
    rows, columns = np.nonzero(true < 2)
    board[rows.min() + 4 : rows.max() - 3, columns.min() + 4 : columns.max() - 3] = True
    assert (found[board] < 2).all() and view[board].all()


def test_depth_registered_to_its_own_camera_is_the_same() -> None:
    depth = seen_by(DEPTH, np.eye(4))
    depth[::7] = 0
    depth[5, 5] = np.nan
    expected = np.nan_to_num(depth)
    np.testing.assert_allclose(registered(depth, DEPTH, DEPTH, np.eye(4)), expected, rtol=1e-6)
    assert not registered(np.zeros_like(depth), DEPTH, COLOUR, np.eye(4)).any()
    assert not registered(depth, DEPTH, COLOUR, from_rotation(np.eye(3), [0, 0, -5.0])).any()  # behind the other


def info(k: Intrinsics, frame: str, **values: Any) -> Any:
    message = messages.camera_info(0.0, k)
    message.header.frame_id = frame
    for name, value in values.items():
        setattr(message, name, value)
    return message


def camera(depth: Any, colour: Any | None, frame_tree: FrameTree | None = None) -> RgbdCamera:
    of_colour = None if colour is None else ImageSource("/rgb/image_raw", colour, colour.header.frame_id)
    of_depth = ImageSource("/depth/image_raw", depth, depth.header.frame_id)
    return RgbdCamera(Path("bag"), of_depth, of_colour, frame_tree or FrameTree())


def linked(T: np.ndarray, prefix: str = "") -> FrameTree:
    tree = FrameTree()
    for name, pose in (("depth", np.eye(4)), ("rgb", T)):
        tree.take(messages.transform(0.0, "camera_link", prefix + name, pose))
    return tree


def images(k: Intrinsics) -> np.ndarray:
    return np.zeros((k.height, k.width, 3), np.uint8)


@pytest.mark.parametrize("prefix", ["", "robot1/"])
def test_depth_of_another_camera_is_registered_by_the_transforms(prefix: str) -> None:
    T = from_rotation(np.eye(3), [0.05, 0.0, 0.01])
    pair = camera(info(DEPTH, "depth"), info(COLOUR, "rgb"), linked(T, prefix))
    metres, rgb = pair.images(seen_by(DEPTH, np.eye(4)), images(COLOUR))
    assert metres.shape == rgb.shape[:2] == (240, 320)
    assert (pair.intrinsics, pair.frame) == (COLOUR, "rgb")
    assert "rgb" in pair.note and "depth" in pair.note
    assert (np.abs(metres - seen_by(COLOUR, T))[metres > 0] < 0.01).mean() > 0.97


def test_without_transforms_it_is_said_that_depth_is_not_registered() -> None:
    zoomed = Intrinsics(160, 120, 1.56 * DEPTH.fx, 1.56 * DEPTH.fy, DEPTH.cx, DEPTH.cy)
    pair = camera(info(DEPTH, "depth"), info(zoomed, "rgb"))
    assert "not registered" in pair.note
    depth = seen_by(DEPTH, np.eye(4))
    np.testing.assert_array_equal(pair.images(depth, images(DEPTH))[0], depth)
    assert (pair.intrinsics, pair.frame) == (DEPTH, "depth")
    with pytest.raises(InputError, match="registered"):
        camera(info(DEPTH, "depth"), info(COLOUR, "rgb"))


def test_colour_of_another_frame_without_camera_info_is_said() -> None:
    source = ImageSource("/rgb/image_raw", None, "rgb")
    of_depth = ImageSource("/depth/image_raw", info(DEPTH, "depth"), "depth")
    for frame_tree, is_said in (
        (FrameTree(), True),
        (linked(from_yaw(0.05, 0, 0, 0)), True),
        (linked(np.eye(4)), False),
    ):
        assert ("rgb" in RgbdCamera(Path("bag"), of_depth, source, frame_tree).note) == is_said


@pytest.mark.parametrize(
    ("frames", "frame_tree"),
    [(("rgb", "rgb"), FrameTree()), (("depth", "rgb"), FrameTree()), (("depth", "rgb"), linked(np.eye(4)))],
)
def test_registered_depth_stays_as_it_is(frames: tuple[str, str], frame_tree: FrameTree) -> None:
    nearly = Intrinsics(160, 120, DEPTH.fx + 0.05, DEPTH.fy, DEPTH.cx + 0.2, DEPTH.cy)
    pair = camera(info(DEPTH, frames[0]), info(nearly, frames[1]), frame_tree)
    depth = seen_by(DEPTH, np.eye(4))
    np.testing.assert_array_equal(pair.images(depth, images(DEPTH))[0], depth)
    assert not pair.note and pair.intrinsics == DEPTH


def test_rectified_images_are_left_as_they_are_and_have_the_intrinsics_of_p() -> None:
    P = np.array([[130.0, 0, 78, 0], [0, 131.0, 61, 0], [0, 0, 1, 0]])
    raw = info(DEPTH, "rgb", d=np.array([0.1, -0.2, 0.01, 0.0, 0.0]), p=P.ravel())
    image = seen_by(DEPTH, np.eye(4))
    rectified = ImageRectifier(Path("bag"), raw, is_rectified=True)
    np.testing.assert_array_equal(rectified.rectified("depth", image), image)
    assert rectified.intrinsics == Intrinsics(160, 120, 130.0, 131.0, 78.5, 61.5)
    straightened = ImageRectifier(Path("bag"), raw)
    assert not np.array_equal(straightened.rectified("depth", image), image)
    assert straightened.intrinsics == DEPTH
    none = info(DEPTH, "rgb", p=np.zeros(12))  # of drivers that fill in K alone
    assert ImageRectifier(Path("bag"), none, is_rectified=True).intrinsics == DEPTH


@pytest.mark.parametrize(
    ("topic", "rectified"),
    [
        ("/camera/color/image_raw", False),
        ("/camera/color/image_raw/compressed", False),
        ("/camera/rgb/image_rect_color", True),
        ("/camera/rgb/image_rect_color/compressed", True),
        ("/camera/depth/image_rect_raw/compressedDepth", True),
        ("/rectangle/image_raw", False),
    ],
)
def test_a_topics_name_says_whether_its_images_are_rectified(topic: str, rectified: bool) -> None:
    assert is_rectified(topic) == rectified


def test_binning_and_the_region_of_interest_shift_the_intrinsics() -> None:
    whole = Intrinsics(640, 480, 560.0, 568.0, 322.0, 242.0)
    roi = messages.make("sensor_msgs/RegionOfInterest", 80, 40, 400, 480, False)  # x, y, height, width
    part = info(whole, "rgb", binning_x=2, binning_y=4, roi=roi)
    k = ImageRectifier(Path("bag"), part).intrinsics
    assert (k.width, k.height) == (240, 100)
    # A place of the sensor is seen at the same place by both.
    points = np.array([(0.1, -0.05, 1.0), (-0.2, 0.02, 1.4)])
    for x, y, z in points:
        u, v = x / z * whole.fx + whole.cx, y / z * whole.fy + whole.cy
        assert x / z * k.fx + k.cx == pytest.approx((u - 80) / 2)
        assert y / z * k.fy + k.cy == pytest.approx((v - 40) / 4)


def kinds(images: tuple[str, ...], infos: tuple[str, ...]) -> dict[str, str]:
    return (
        dict.fromkeys(images, IMAGE_TYPES[0]) | dict.fromkeys(infos, INFO_TYPE) | {"/odom": "nav_msgs/msg/Odometry"}
    )


VIEWER = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"


@pytest.mark.parametrize(
    ("topic", "images", "infos", "expected"),
    [
        ("/c/d/image_raw", ("/c/rgb/image",), ("/c/d/camera_info", "/c/rgb/camera_info"), "/c/d/camera_info"),
        ("/c/d/image_raw/compressedDepth", (), ("/c/d/camera_info", "/c/camera_info"), "/c/d/camera_info"),
        (f"{VIEWER[0]}/image/data", (f"{VIEWER[1]}/image/data",), tuple(f"{v}/info/camera_info" for v in VIEWER),
         f"{VIEWER[0]}/info/camera_info"),
        ("/c/depth/image_raw", ("/c/rgb/image",), ("/c/rgb/camera_info",), None),
        ("/c/depth/image_raw", ("/c/rgb/image",), ("/c/camera_info",), "/c/camera_info"),
        ("/depth/image_raw", ("/rgb/image",), ("/camera_info",), None),
    ],
)  # fmt: skip
def test_the_camera_info_of_images_is_the_nearest_by_name(
    topic: str, images: tuple[str, ...], infos: tuple[str, ...], expected: str | None
) -> None:
    assert info_topic(topic, kinds((topic, *images), infos)) == expected
