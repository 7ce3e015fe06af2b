"""Depth images: which of their numbers are measurements."""

import cv2
import numpy as np
import pytest

from pipeline.datasets.images import colour_of, depth_of, metres
from pipeline.plugins.ros import messages


@pytest.mark.parametrize("nothing", [0, -1, np.nan, np.inf, -np.inf, 1e10, 65504, np.finfo(np.float32).max])
def test_numbers_that_stand_for_no_return_are_none(nothing: float) -> None:
    np.testing.assert_array_equal(metres(np.array([[2.5, nothing]], np.float32)), [[2.5, 0]])


@pytest.mark.parametrize("kind", ["16UC1", "mono16", "16UC1; compressedDepth png", "32FC1; compressedDepth png"])
def test_the_largest_number_is_no_return_in_every_message(kind: str) -> None:
    pixels = np.array([[2500, 65535], [0, 65534]], np.uint16)
    head = np.frombuffer(b"\0\0\0\0" + np.array([10100, -1009], np.float32).tobytes(), np.uint8)
    png = np.concatenate([head, cv2.imencode(".png", pixels)[1].ravel()])
    compressed = ";" in kind
    message = messages.compressed_image(0, kind, png) if compressed else messages.image(0, kind, pixels)
    depth = depth_of(message)
    np.testing.assert_array_equal(depth > 0, [[True, False], [False, True]])
    np.testing.assert_allclose(depth[0, 0], 10100 / 3509 if "32FC1" in kind else 2.5)


RGB = np.random.default_rng(0).integers(0, 256, (6, 8, 3)).astype(np.uint8) // 64 * 64
FLAT = np.broadcast_to(np.array([200, 90, 30], np.uint8), (6, 8, 3))


def mosaic(pattern: str) -> np.ndarray:
    """FLAT as a sensor sees it behind filters, of which the first two rows and columns are named."""
    cells = [[FLAT[0, 0, "rgb".index(pattern[2 * (v % 2) + u % 2])] for u in range(8)] for v in range(6)]
    return np.array(cells, np.uint8)


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("RGB8", RGB, RGB),
        ("8UC4", np.dstack([RGB[..., ::-1], RGB[..., :1]]), RGB),
        ("8UC1", RGB[..., 0], np.dstack([RGB[..., 0]] * 3)),
        ("rgb16", RGB.astype(np.uint16) * 257, RGB),
        ("bgra16", np.dstack([RGB[..., ::-1], RGB[..., :1]]).astype(np.uint16) * 257, RGB),
        ("uyvy", cv2.cvtColor(FLAT.copy(), cv2.COLOR_RGB2YUV_UYVY), FLAT),
        ("yuv422", cv2.cvtColor(FLAT.copy(), cv2.COLOR_RGB2YUV_UYVY), FLAT),
        ("yuyv", cv2.cvtColor(FLAT.copy(), cv2.COLOR_RGB2YUV_YUY2), FLAT),
        *((f"bayer_{pattern}8", mosaic(pattern), FLAT) for pattern in ("rggb", "bggr", "gbrg", "grbg")),
    ],
)
def test_colours_come_back_from_what_drivers_send(encoding: str, pixels: np.ndarray, expected: np.ndarray) -> None:
    found = colour_of(messages.image(0, encoding, np.ascontiguousarray(pixels)))
    np.testing.assert_allclose(found.astype(int), expected, atol=3)
