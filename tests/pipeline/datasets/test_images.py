"""Depth images: which of their numbers are measurements."""

import cv2
import numpy as np
import pytest

from pipeline.datasets.images import depth_of, metres
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
