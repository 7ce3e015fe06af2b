"""Rectify the images of a camera with lens distortion, as if a pinhole camera had taken them."""

from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.datasets.messages import Message
from pipeline.errors import InputError, required
from pipeline.frame import ONE_SIZE, Calibration, Intrinsics

MODELS = ("plumb_bob", "Brown Conrady", "rational_polynomial", "")  # The second name is RealSense's
INTRINSICS_TOLERANCE = 1e-3  # Maximum relative difference between the intrinsics of one camera on two topics


class ImageRectifier:
    """Rectifies images according to a camera_info.

    Attributes:
        intrinsics: intrinsics of the rectified images.
    """

    def __init__(
        self, path: Path, info: Message | None, calibration: Calibration | None = None, is_rectified: bool = False
    ):
        """Determine the intrinsics of the images.

        Args:
            path: the bag, for error messages.
            info: camera_info of the images.
            calibration: calibration without distortion that overrides ``info``.
            is_rectified: whether the images are already rectified, so that the matrix P of ``info`` applies, not K.

        Raises:
            InputError: the camera's intrinsics are missing or invalid, or its distortion model is unknown.
        """
        self._path = path
        if calibration is None and info is None:
            raise InputError(f"{path}: no camera_info for the depth images; give --intrinsics fx fy cx cy")
        self._size = None if info is None or not info.width else _size(info)
        self._distortion: tuple[NDArray, NDArray] | None = None
        self._maps: tuple[NDArray, NDArray] | None = None
        K, d = (np.eye(3), np.zeros(0)) if info is None else _matrix_and_distortion(info, is_rectified)
        values = calibration or Calibration(K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        if not np.isfinite(values).all() or min(values) <= 0:
            given = " ".join(f"{value:g}" for value in values)
            raise InputError(f"{path}: camera intrinsics fx fy cx cy must be positive and finite, not {given}")
        self._values = values
        if calibration is None and info is not None and d.any():
            if info.distortion_model not in MODELS:
                raise InputError(
                    f"{path}: distortion model {info.distortion_model!r} is not supported; rectify the images"
                )
            self._distortion = K, d
            self._undistortion_maps((1, 1))  # to raise an error as early as possible

    def has_same_intrinsics(self, other: "ImageRectifier") -> bool:
        """Whether another camera has the same intrinsics, and images of the same size."""
        return self.has_same_size(other) and bool(
            np.allclose(self._values, other._values, rtol=INTRINSICS_TOLERANCE, atol=0.5)
        )

    def has_same_size(self, other: "ImageRectifier") -> bool:
        """Whether another camera's images have the same size; True if one of the sizes is unknown."""
        return None in (self._size, other._size) or self._size == other._size

    def __str__(self) -> str:
        size = "" if self._size is None else f"{self._size[1]} × {self._size[0]}, "
        return f"{size}fx {self._values.fx:.1f}"

    @property
    def intrinsics(self) -> Intrinsics:
        """Intrinsics of the rectified images, known from ``info`` or after the first image.

        cx and cy are shifted by half a pixel, because ROS has pixel centres at integers.
        """
        height, width = required(self._size)
        fx, fy, cx, cy = self._values
        return Intrinsics(width, height, fx, fy, cx + 0.5, cy + 0.5)

    def rectified(self, kind: Literal["depth", "colour"], image: NDArray) -> NDArray:
        """The rectified image, (H, W) or (H, W, 3); InputError if ``image`` does not have the expected size."""
        self._size = self._size or image.shape[:2]
        if image.shape[:2] != self._size:
            (h, w), (height, width) = image.shape[:2], self._size
            size = f"a {kind} image has {w} × {h} pixels instead of {width} × {height}"
            raise InputError(f"{self._path}: {ONE_SIZE}, but {size}")
        if self._distortion is None:
            return image
        if self._maps is None:
            self._maps = self._undistortion_maps(self._size)
        return cv2.remap(image, *self._maps, cv2.INTER_NEAREST if kind == "depth" else cv2.INTER_LINEAR)

    def _undistortion_maps(self, size: tuple[int, int]) -> tuple[NDArray, NDArray]:
        """(H, W) column and (H, W) row of each rectified pixel in the distorted image.

        Raises:
            InputError: the number of distortion coefficients is invalid.
        """
        K, d = required(self._distortion)
        try:
            return cv2.initUndistortRectifyMap(K, d, np.eye(3), K, size[::-1], cv2.CV_32FC1)
        except cv2.error as error:
            found = f"camera_info must have 4, 5, 8, 12 or 14 distortion coefficients, not {len(d)}"
            raise InputError(f"{self._path}: {found}") from error


def _matrix_and_distortion(info: Message, is_rectified: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(3, 3) camera matrix and (N,) distortion coefficients; in ROS 1, the names of these fields are upper-case."""
    K, d, P = (info.k, info.d, info.p) if hasattr(info, "k") else (info.K, info.D, info.P)
    K, P = K.reshape(3, 3), P.reshape(3, 4)
    if is_rectified:
        K, d = P[:, :3] if P.any() else K, np.zeros(0)
    return _sensor_to_image(info) @ K, d


def _binning(info: Message) -> tuple[int, int]:
    """Number of sensor pixels, across and down, per image pixel; 0 in the message means 1."""
    return max(info.binning_x, 1), max(info.binning_y, 1)


def _size(info: Message) -> tuple[int, int]:
    """Height and width of the images, pixels, which show the region of interest after binning."""
    (across, down), roi = _binning(info), info.roi
    return (roi.height or info.height) // down, (roi.width or info.width) // across


def _sensor_to_image(info: Message) -> NDArray[np.float64]:
    """(3, 3) transform from pixels of the full sensor, which a camera_info describes, to pixels of the images.

    Pixel centres are at integers, so an image begins at -0.5.
    """
    (across, down), roi = _binning(info), info.roi
    x, y = (roi.x_offset, roi.y_offset) if roi.width and roi.height else (0, 0)
    scale, shift = np.array([1 / across, 1 / down, 1.0]), np.array([0.5 - x, 0.5 - y])
    window = np.diag(scale)
    window[:2, 2] = shift * scale[:2] - 0.5
    return window
