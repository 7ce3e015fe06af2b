"""Places what was read in an image: by the depth in its outline, or without depth in its direction alone."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from pipeline.frame import Frame
from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.thinning import first_in_voxels
from pipeline.tracks.find import PRINTED, Reading
from pipeline.tracks.likelihood import EXTENTS, weigh
from pipeline.tracks.sought import THING_GAP
from pipeline.transforms import transform_points

POSE_SIGMA = 0.03
"""m, standard deviation of a keyframe's position: the error of trajectories in the benchmark's arenas."""
KEPT_VOXEL = 0.025
"""m, edge of the voxels in each of which one of a sighting's points is kept."""


@dataclass(frozen=True, eq=False)
class FindSighting:
    """A thing as one keyframe shows it, in ``base_link`` of the keyframe or, moved, in ``map``.

    Attributes:
        reading: in the image.
        keyframe: number of its keyframe.
        position: (3,) float64 its middle, m; without depth, where the camera's range ends in its direction.
        information: (3, 3) float64 inverse of the position's covariance, 1/m².
        camera: (3,) float64 position of the camera, m.
        has_depth: whether the depth tells how far away it is.
        time: of the frame, s.
        photo: (h, w, 3) uint8 that shows it.
        points: (N, 3) float32 its own returns, thinned, m.
    """

    reading: Reading
    keyframe: int
    position: NDArray[np.float64]
    information: NDArray[np.float64]
    camera: NDArray[np.float64]
    has_depth: bool
    time: float
    photo: NDArray[np.uint8]
    points: NDArray[np.float32]

    def moved(self, T: NDArray[np.float64]) -> "FindSighting":
        """The same sighting moved by the 4×4 transform ``T``."""
        R, t = T[:3, :3], T[:3, 3]
        information = R @ self.information @ R.T
        position, camera, points = R @ self.position + t, R @ self.camera + t, moved(T, self.points)
        return replace(self, position=position, camera=camera, information=information, points=points)


def sight(frame: Frame, reading: Reading, keyframe: int, T_map_base: NDArray[np.float64]) -> FindSighting:
    """A reading of a frame's image as a sighting in ``map``, with the robot at a 4×4 pose.

    A flat thing's depth is the median within its outline. Of another thing the middle of its own returns
    is taken, and parts of it may be hidden. Without depth, it may be anywhere in its direction; so may what gives no
    return from most of its outline, for the rest is the rim of something nearer.
    """
    outline = _inside(frame, reading)
    inside = outline & frame.returns
    inside &= inside.sum() > outline.sum() / 2
    depth = frame.depth[inside]
    z = float(np.median(depth)) if depth.size else frame.sensor.farthest
    k, (u, v) = frame.intrinsics, reading.corners.mean(axis=0)
    in_camera = np.array([(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0]) * z
    # Along the ray as uncertain as the depth, or as its whole range; across it by a pixel.
    along = frame.sensor.sigma(z) if depth.size else z
    ray = in_camera / np.linalg.norm(in_camera)
    covariance = np.outer(ray, ray) * along**2 + np.eye(3) * ((z / k.fx) ** 2 + POSE_SIGMA**2)
    T_map_camera = T_map_base @ frame.T_base_camera
    points = k.rays[inside] * depth[:, None]
    if depth.size:
        reading, belongs = _weighed(reading, transform_points(T_map_camera, points), T_map_camera, T_map_base[2, 3])
        if reading.kind not in PRINTED:
            points = points[belongs if belongs.any() else np.abs(depth - z) < THING_GAP]
            own = points.astype(np.float64)
            in_camera = (own.min(axis=0) + own.max(axis=0)) / 2
            covariance += np.diag(np.ptp(own, axis=0) / 2) ** 2
    points = points.astype(np.float32)
    seen = FindSighting(
        reading=reading,
        keyframe=keyframe,
        position=in_camera,
        information=np.linalg.inv(covariance).astype(np.float64),
        camera=np.zeros(3),
        has_depth=depth.size > 0,
        time=frame.time,
        photo=photo_of(frame.rgb, reading.box),
        points=points[first_in_voxels(points, 1 / KEPT_VOXEL)],
    )
    return seen.moved(T_map_camera)


def _weighed(
    reading: Reading, points: NDArray[np.float32], T_map_camera: NDArray[np.float64], ground: float
) -> tuple[Reading, NDArray[np.bool_]]:
    """A reading, as sure as its points (N, 3) in ``map`` make it, and which (N,) belong to the thing."""
    if reading.kind not in EXTENTS:
        return reading, np.zeros(len(points), np.bool_)
    weighed = weigh(reading.kind, points, ground, camera=T_map_camera[:3, 3])
    return replace(reading, confidence=float(expit(logit(reading.confidence) + weighed.log_ratio))), weighed.belongs


def _inside(frame: Frame, reading: Reading) -> NDArray[np.bool_]:
    """(H, W) bool, the pixels within an outline."""
    mask = np.zeros(frame.depth.shape, np.uint8)
    outline = cv2.convexHull(reading.corners.astype(np.float32) - np.float32(0.5))
    cv2.fillConvexPoly(mask, np.round(outline).astype(np.int32), 1)
    return mask.astype(np.bool_)


def photo_of(
    rgb: NDArray[np.uint8], box: tuple[float, float, float, float], margin: float = 1 / 2
) -> NDArray[np.uint8]:
    """A copy of an image (H, W, 3) within a box, pixels, and a margin around it, a share of its longer side."""
    x0, y0, x1, y1 = box
    more = margin * max(x1 - x0, y1 - y0)
    rows = slice(max(0, int(y0 - more)), int(np.ceil(y1 + more)))
    return rgb[rows, max(0, int(x0 - more)) : int(np.ceil(x1 + more))].copy()
