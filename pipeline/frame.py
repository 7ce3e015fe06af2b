"""A frame of the RGB-D camera."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from io import BytesIO
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import Depth, Mask, PixelMask, Points, Pose, Rgb
from pipeline.errors import InputError
from pipeline.files import silenced
from pipeline.sensor import XTION, SensorModel

ONE_SIZE = "all images must be the same size, with depth registered to colour"  # For error messages
SAME_TIME = 0.02
"""Maximum time between a depth image and its colour image, s, as in the TUM benchmark's tool."""


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion; lengths in pixels, pixel centres at integer + 0.5."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def rays(self) -> NDArray[np.float32]:
        """(H, W, 3) points at a depth of 1 m through the centre of every pixel, in ``camera_optical``."""
        return _rays(self)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """3×3 camera matrix as in OpenCV, Open3D and ROS, whose pixel centres are at integers."""
        return np.array([[self.fx, 0, self.cx - 0.5], [0, self.fy, self.cy - 0.5], [0, 0, 1]])

    @property
    def frustum(self) -> NDArray[np.float64]:
        """(5, 3) the optical centre, and the corners of the view at a depth of 1 m, in ``camera_optical``."""
        u = (np.array([0, self.width]) - self.cx) / self.fx
        v = (np.array([0, self.height]) - self.cy) / self.fy
        return np.array([(0, 0, 0), *((a, b, 1) for a in u for b in v)])

    @property
    def half_fov(self) -> float:
        """Angle from the optical axis to the nearer side of the image, rad."""
        return float(min(np.arctan2(self.cx, self.fx), np.arctan2(self.width - self.cx, self.fx)))

    def points(self, depth: Depth, T_target_camera: Pose) -> Points:
        """All returns of a depth image, row-major, in the target frame.

        Raises:
            InputError: the image does not have the size of these intrinsics.
        """
        if depth.shape != (self.height, self.width):
            size = " × ".join(map(str, depth.shape[::-1]))
            raise InputError(f"a depth image of {size} pixels: its intrinsics are for {self.width} × {self.height}")
        T = T_target_camera.astype(np.float32)
        x, y = self.rays[0, :, 0], self.rays[:, 0, 1]
        return _points_of(np.ascontiguousarray(depth, np.float32), x, y, T[:3, :3], T[:3, 3])

    def project(self, points: NDArray[np.floating]) -> tuple[NDArray[np.int64], Mask]:
        """The pixels into which points project.

        Args:
            points: (N, 3) m in ``camera_optical``.

        Returns:
            (N, 2) int64 row and column of each point, and (N,) whether the point lies in front of the camera and
            within the image. The row and column of any other point are meaningless.
        """
        depth = np.maximum(points[:, 2], 1e-6)
        column = np.floor(points[:, 0] / depth * self.fx + self.cx).astype(np.int64)
        row = np.floor(points[:, 1] / depth * self.fy + self.cy).astype(np.int64)
        inside = (points[:, 2] > 0) & (column >= 0) & (row >= 0) & (column < self.width) & (row < self.height)
        return np.stack([row, column], axis=1), inside


@lru_cache(maxsize=8)
def _rays(k: Intrinsics) -> NDArray[np.float32]:
    """The rays, computed once for equal cameras, because a loaded map has an ``Intrinsics`` for each keyframe."""
    v, u = np.mgrid[0.5 : k.height, 0.5 : k.width]
    return np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1).astype(np.float32)


@njit(cache=True, nogil=True)
def _points_of(
    depth: Depth, x: NDArray[np.float32], y: NDArray[np.float32], R: NDArray[np.float32], t: NDArray[np.float32]
) -> Points:
    """Returns of a depth image, rotated by ``R`` and translated by ``t``; its rays have (W,) ``x`` and (H,) ``y``."""
    is_return = (depth > 0) & (depth < np.inf)
    points, n = np.empty((np.count_nonzero(is_return), 3), np.float32), 0
    for v in range(len(y)):
        for u in range(len(x)):
            if is_return[v, u]:
                z = depth[v, u]
                for row in range(3):
                    points[n, row] = R[row, 0] * (x[u] * z) + R[row, 1] * (y[v] * z) + R[row, 2] * z + t[row]
                n += 1
    return points


class Calibration(NamedTuple):
    """Camera intrinsics in the convention of calibrations: pixel centres are at integers."""

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, eq=False)
class Frame:
    """One image pair of the RGB-D camera.

    Attributes:
        time: time at which the images were taken, s.
        rgb, depth: the images.
        intrinsics: intrinsics of both images, which are registered to each other.
        T_base_camera: pose of ``camera_optical`` in ``base_link``.
        T_odom_base: pose of ``base_link`` in ``odom`` from the robot's odometry.
        label: (H, W) uint8 true label of every pixel; None without a simulator.
        instance: (H, W) int32 id of the geom, a shape in the MJCF, at every pixel, -1 = none; an object, such as a
            person, may consist of several geoms. None without a simulator.
        sensor: the camera that measured the depth.
        thermal: (h, w) float32 temperatures, °C, registered to the colour image, with the same field of view; None
            without a thermal camera.
    """

    time: float
    rgb: Rgb
    depth: Depth
    intrinsics: Intrinsics
    T_base_camera: Pose
    T_odom_base: Pose
    label: NDArray[np.uint8] | None = None
    instance: NDArray[np.int32] | None = None
    sensor: SensorModel = XTION
    thermal: NDArray[np.float32] | None = None

    @cached_property
    def returns(self) -> PixelMask:
        """The pixels with a depth return."""
        return np.isfinite(self.depth) & (self.depth > 0)

    @property
    def depth_mm(self) -> NDArray[np.uint16]:
        """(H, W) depth along the optical axis in whole mm, as depth images are stored; 0 = no return."""
        depth = np.where(self.returns, self.depth, 0)
        return np.rint(1e3 * depth).clip(max=np.iinfo(np.uint16).max).astype(np.uint16)

    def points(self, T_target_camera: Pose) -> Points:
        """All returns, row-major over the image, in the target frame."""
        return self.intrinsics.points(self.depth, T_target_camera)

    def every_nth(self, n: int) -> tuple[Depth, Intrinsics]:
        """The depth of every ``n``-th pixel of every ``n``-th row, and the intrinsics of that image."""
        k, first = self.intrinsics, n // 2
        depth = self.depth[first::n, first::n]
        # The first pixel of the new image has the same centre as this pixel in the old image.
        cx, cy = ((c - first - 0.5) / n + 0.5 for c in (k.cx, k.cy))
        return depth, Intrinsics(depth.shape[1], depth.shape[0], k.fx / n, k.fy / n, cx, cy)


def decoded(content: bytes | NDArray[np.uint8], flags: int) -> NDArray:
    """(H, W, ...) pixels of an encoded image, read with flags of ``cv2.imread``; InputError if it is not an image.

    An image is rejected if its header declares more than ``OPENCV_IO_MAX_IMAGE_PIXELS`` pixels.
    """
    try:
        with silenced():
            image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:  # The image is too large
        image = None
    if image is None:
        raise InputError("the image cannot be decoded: it is damaged, too large or in an unknown format")
    return image


def jpeg(rgb: Rgb) -> bytes:
    """An image encoded as JPEG with Pillow's default quality."""
    content = BytesIO()
    Image.fromarray(rgb).save(content, "JPEG")
    return content.getvalue()
