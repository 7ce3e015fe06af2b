"""Rectifies the images of a camera with distortion to those of a pinhole camera."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Rgb
from pipeline.errors import InputError
from pipeline.frame import Calibration, Intrinsics
from pipeline.ros.messages import Message

MODELS = ("plumb_bob", "rational_polynomial", "")  # Of distortion, by their names in ROS


class Pinhole:
    """Rectifies images by a camera_info.

    Attributes:
        intrinsics: of the rectified images.
    """

    def __init__(self, path: Path, info: Message | None, calibration: Calibration | None = None):
        """``info`` is of the depth images of a bag at ``path``; a calibration, without distortion, overrides it.

        Raises:
            InputError: the camera's intrinsics are missing or impossible, or its distortion model is unknown.
        """
        self._path = path
        if calibration is None and info is None:
            raise InputError(f"{path}: holds no camera_info of the depth images; --intrinsics fx fy cx cy sets them")
        self._size = None if info is None or not info.width else (info.height, info.width)
        self._distortion: tuple[NDArray, NDArray] | None = None
        self._maps: tuple[NDArray, NDArray] | None = None
        K, d = (np.eye(3), np.zeros(0)) if info is None else _matrix_and_distortion(info)
        values = calibration or Calibration(K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        if not np.isfinite(values).all() or min(values) <= 0:
            given = " ".join(f"{value:g}" for value in values)
            raise InputError(f"{path}: the camera's intrinsics make no sense: fx fy cx cy are {given}")
        self._values = values
        if calibration is None and info is not None and d.any():
            if info.distortion_model not in MODELS:
                raise InputError(f"{path}: images of the distortion {info.distortion_model!r}; rectify them first")
            self._distortion = K, d
            self._find_maps((1, 1))  # for an error as early as possible

    @property
    def intrinsics(self) -> Intrinsics:
        """Known from ``info`` or after the first image; cx and cy are shifted: ROS has pixel centres at integers."""
        assert self._size is not None
        fx, fy, cx, cy = self._values
        return Intrinsics(self._size[1], self._size[0], fx, fy, cx + 0.5, cy + 0.5)

    def depth(self, image: Depth) -> Depth:
        """A rectified depth image; InputError if its size differs from that of the images before."""
        return self._rectified("depth", image, cv2.INTER_NEAREST)

    def colour(self, image: Rgb) -> Rgb:
        """A rectified colour image; InputError if its size differs from that of the depth images."""
        return self._rectified("colour", image, cv2.INTER_LINEAR)

    def _rectified(self, kind: str, image: NDArray, interpolation: int) -> NDArray:
        self._size = self._size or image.shape[:2]
        if image.shape[:2] != self._size:
            (h, w), (height, width) = image.shape[:2], self._size
            size = f"{kind} images of {w} × {h} pixels where {width} × {height} are expected"
            raise InputError(f"{self._path}: {size}; depth must be registered to colour, and all be of one size")
        if self._distortion is None:
            return image
        if self._maps is None:
            self._maps = self._find_maps(self._size)
        return cv2.remap(image, *self._maps, interpolation)

    def _find_maps(self, size: tuple[int, int]) -> tuple[NDArray, NDArray]:
        """Two (H, W) pixel coordinates in the distorted image, one for each pixel; InputError if there are none."""
        assert self._distortion is not None
        K, d = self._distortion
        try:
            return cv2.initUndistortRectifyMap(K, d, np.eye(3), K, size[::-1], cv2.CV_32FC1)
        except cv2.error as error:
            raise InputError(f"{self._path}: {len(d)} coefficients of distortion are of no model") from error


def _matrix_and_distortion(info: Message) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(3, 3) camera matrix and (N,) distortion of a camera_info; their names in ROS 1 are capital letters."""
    K, d = (info.k, info.d) if hasattr(info, "k") else (info.K, info.D)
    return K.reshape(3, 3), d
