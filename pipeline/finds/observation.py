"""Locate what was read in an image: by the depth in its outline or, without depth, only by its direction."""

from dataclasses import replace

import cv2
import numpy as np
from scipy.special import expit, logit

from pipeline.arrays import Mask, PixelMask, Points, Pose
from pipeline.finds.objects import ObjectPolicy
from pipeline.frame import Frame
from pipeline.geometry.thinning import first_in_voxels
from pipeline.tracks.config import WEIGHED, LikelihoodConfig
from pipeline.tracks.find import Reading
from pipeline.tracks.likelihood import weigh
from pipeline.tracks.pictures import photo_of
from pipeline.tracks.track import Observation
from pipeline.transforms import transform_points


def sight(frame: Frame, reading: Reading, keyframe: int, T_map_base: Pose, policy: ObjectPolicy) -> Observation:
    """An observation in ``map`` of what was read in a frame's image.

    A flat object's depth is the median within its outline. Another object is located at the middle of its own
    returns, with an uncertainty for hidden parts. Without depth, an object may be anywhere in its direction; so may
    one with returns in at most half of its outline, because these may be from the rim of something nearer.
    """
    outline = _inside(frame, reading)
    inside = outline & frame.returns
    inside &= inside.sum() > outline.sum() / 2
    depth = frame.depth[inside]
    z = float(np.median(depth)) if depth.size else frame.sensor.farthest
    k, (u, v) = frame.intrinsics, reading.corners.mean(axis=0)
    in_camera = np.array([(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0]) * z
    # The uncertainty along the ray is that of the depth, or the whole range; across the ray, it is a pixel.
    along = frame.sensor.sigma(z) if depth.size else z
    ray = in_camera / np.linalg.norm(in_camera)
    covariance = np.outer(ray, ray) * along**2 + np.eye(3) * ((z / k.fx) ** 2 + policy.pose_sigma**2)
    T_map_camera = T_map_base @ frame.T_base_camera
    points = k.rays[inside] * depth[:, None]
    if depth.size:
        reading, belongs = _weighed(
            reading, transform_points(T_map_camera, points), T_map_camera, T_map_base[2, 3], policy.likelihood
        )
        if not policy.is_flat:
            points = points[belongs if belongs.any() else np.abs(depth - z) < policy.gap]
            own = points.astype(np.float64)
            in_camera = (own.min(axis=0) + own.max(axis=0)) / 2
            covariance += np.diag(np.ptp(own, axis=0) / 2) ** 2
    points = points.astype(np.float32)
    seen = Observation(
        reading=reading,
        keyframe=keyframe,
        position=in_camera,
        information=np.linalg.inv(covariance).astype(np.float64),
        camera=np.zeros(3),
        has_depth=depth.size > 0,
        time=frame.time,
        photo=photo_of(frame.rgb, reading.box, policy.photo_margin),
        points=points[first_in_voxels(points, 1 / policy.kept_voxel)],
    )
    return seen.moved(T_map_camera)


def _weighed(
    reading: Reading, points: Points, T_map_camera: Pose, ground: float, config: LikelihoodConfig
) -> tuple[Reading, Mask]:
    """A reading with its confidence updated from its points, and which of these belong to the object."""
    if reading.kind not in WEIGHED:
        return reading, np.zeros(len(points), np.bool_)
    weighed = weigh(reading.kind, points, ground, config, camera=T_map_camera[:3, 3])
    return replace(reading, confidence=float(expit(logit(reading.confidence) + weighed.log_ratio))), weighed.belongs


def _inside(frame: Frame, reading: Reading) -> PixelMask:
    """The pixels within a reading's outline."""
    mask = np.zeros(frame.depth.shape, np.uint8)
    outline = cv2.convexHull(reading.corners.astype(np.float32) - np.float32(0.5))
    cv2.fillConvexPoly(mask, np.round(outline).astype(np.int32), 1)
    return mask.astype(np.bool_)
