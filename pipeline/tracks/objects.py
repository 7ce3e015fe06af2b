"""Locate signs, codes, objects and heat with the depth of an image, and track them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from pipeline.arrays import Mask, PixelMask, Points, Pose
from pipeline.frame import Frame
from pipeline.geometry.thinning import first_in_voxels
from pipeline.sensor import SensorModel
from pipeline.tracks.config import ObjectConfig
from pipeline.tracks.find import Reading
from pipeline.tracks.likelihood import relative_positions, weigh
from pipeline.tracks.pictures import photo_of
from pipeline.tracks.track import GATE, Location, Observation, Track, TrackPolicy, mahalanobis
from pipeline.transforms import inverse, transform_points

MIN_DISTANCE_FRACTION = 0.5
"""Minimum distance of another look, as a fraction of the shortest distance so far."""
MAX_SIDE_ANGLE = radians(40)
"""Maximum angle to an earlier line of sight, rad; at greater angles, a sign looks narrower or is hidden."""
SIGMAS = 3.0
"""Maximum difference in depth between an object and its return, in standard deviations of the object's position."""
MIN_DEPTH_GAP = 0.3
"""Minimum difference in depth between an object and other objects in front of or behind it, m."""
POSE_SIGMA = 0.03
"""Standard deviation of a keyframe's position, m, from trajectories in the benchmark's arenas."""
KEPT_VOXEL = 0.025
"""Edge length of voxels, m, in each of which one point of an observation is kept."""
PHOTO_MARGIN = 0.5
"""Margin of a photo around the object's box, as a fraction of the box's longer side."""


@dataclass(frozen=True, kw_only=True)
class ObjectPolicy(ObjectConfig, TrackPolicy):
    """Tracks objects; objects that were seen only small or without depth are looked at again from nearer."""

    def locate(self, placed: Sequence[Observation]) -> Location:
        """The information-weighted mean of the observed positions, with the covariance of the best observation.

        Further observations do not reduce the covariance, because their errors are correlated.
        """
        counting = with_depth(placed)
        total = sum(seen.information for seen in counting)
        position = np.linalg.solve(total, sum(seen.information @ seen.position for seen in counting))
        best = max(counting, key=lambda seen: np.linalg.det(seen.information))
        covariance = np.asarray(np.linalg.inv(best.information), np.float64)
        return Location(np.asarray(position, np.float64), covariance, position[None].astype(np.float32))

    def photo_score(self, observation: Observation) -> float:
        """Side of the object in the image, pixels, times the confidence."""
        return observation.reading.confidence * observation.reading.side

    def distance(self, track: Track, new: Track) -> float:
        """Squared Mahalanobis distance; infinite for codes with different texts."""
        is_other = self.has_checksum and bool(track.text and new.text) and track.text != new.text
        return np.inf if is_other else mahalanobis(track, new)

    def merge_distance(self, one: Track, other: Track) -> float:
        """Squared Mahalanobis distance within the gate, else infinite; flat objects in one keyframe are distinct."""
        if self.is_flat and one.keyframes & other.keyframes:
            return np.inf
        distance = self.distance(one, other)
        return distance if distance <= GATE else np.inf

    def is_expected_in_view(self, track: Track, frame: Frame, T_camera_map: Pose) -> bool:
        """Whether the object is in the image, not hidden, and as near and from the same side as in earlier views."""
        if not track.has_depth:
            return False
        here = inverse(T_camera_map)[:3, 3]
        position, cameras = track.position, np.array(track.camera_positions)
        ways = cameras - position
        if np.linalg.norm(here - position) > np.linalg.norm(ways, axis=1).max():
            return False
        bearing = (here - position) @ ways.T / np.linalg.norm(here - position) / np.linalg.norm(ways, axis=1)
        if bearing.max() < np.cos(MAX_SIDE_ANGLE):
            return False
        point = transform_points(T_camera_map, position[None])
        pixels, inside = frame.intrinsics.project(point)
        if not inside.any() or point[0, 2] <= 0:
            return False
        row, column = pixels[inside][0]
        measured = float(frame.depth[row, column])
        return measured > 0 and abs(measured - point[0, 2]) < SIGMAS * np.sqrt(track.covariance.trace())

    def is_worth_a_look(self, track: Track) -> bool:
        """Whether an object has no depth or is unread, and was missed less often than seen.

        An object with a checksum is unread if no text was decoded. A flat object without a checksum is unread if it
        always looked too small. An object that is recognised by its shape never counts as unread: in arenas without
        finds, drives to see such objects again made exploration take 25% longer.
        """
        largest = max(seen.reading.side for seen in track.seen)
        is_unread = not track.text if self.has_checksum else self.is_flat and largest < self.min_readable_side
        return (is_unread or not track.has_depth) and len(track.missed) < len(track.keyframes)

    def viewing_range(self, track: Track, sensor: SensorModel) -> tuple[float, float]:
        """Minimum and maximum distance, m, at which an object is in range and, if it looked small, can be read."""
        nearest = min(track.placed, key=lambda seen: float(np.linalg.norm(seen.position - seen.camera)))
        way = float(np.linalg.norm(nearest.position - nearest.camera))
        share = max(nearest.reading.side / self.min_readable_side, MIN_DISTANCE_FRACTION)
        readable = way * share if track.has_depth else sensor.farthest
        return sensor.nearest, min(sensor.farthest - sensor.margin, max(readable, sensor.nearest + sensor.margin))


def with_depth(placed: Sequence[Observation]) -> Sequence[Observation]:
    """The observations with depth, or all observations if none has depth and the object's distance is a guess."""
    return [seen for seen in placed if seen.has_depth] or placed


def best_returns(track: Track) -> Points:
    """The object's returns in the observation with the best photo; observations with depth take precedence."""
    return max(with_depth(track.placed), key=track.policy.photo_score).points


def observe_reading(
    frame: Frame, reading: Reading, keyframe: int, T_map_base: Pose, policy: ObjectPolicy
) -> Observation:
    """An observation, in ``map``, of a reading in a frame's image.

    A flat object's depth is the median within its outline. Any other object is located at the middle of its own
    returns, with an uncertainty for hidden parts. Without depth, an object may be anywhere in its direction. Returns
    in at most half of its outline are not used, because they may be from the rim of a nearer object.
    """
    outline = _outline_mask(frame, reading)
    inside = outline & frame.returns
    inside &= inside.sum() > outline.sum() / 2
    depth = frame.depth[inside]
    z = float(np.median(depth)) if depth.size else frame.sensor.farthest
    k, (u, v) = frame.intrinsics, reading.corners.mean(axis=0)
    in_camera = np.array([(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0]) * z
    # The uncertainty along the ray is the depth's or, without depth, the whole range; across the ray, it is a pixel.
    along = frame.sensor.sigma(z) if depth.size else z
    ray = in_camera / np.linalg.norm(in_camera)
    covariance = np.outer(ray, ray) * along**2 + np.eye(3) * ((z / k.fx) ** 2 + POSE_SIGMA**2)
    T_map_camera = T_map_base @ frame.T_base_camera
    points = k.rays[inside] * depth[:, None]
    if depth.size:
        in_map, in_box = transform_points(T_map_camera, points), relative_positions(inside, outline)
        reading, belongs = _with_confidence_updated(reading, in_map, in_box, T_map_base[2, 3], policy)
        if not policy.is_flat:
            near = np.abs(depth - z) < MIN_DEPTH_GAP
            # If half of the returns lie behind a gap, the median may be in the gap.
            points = points[belongs if belongs.any() else near if near.any() else depth <= z]
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
        photo=photo_of(frame.rgb, reading.box, PHOTO_MARGIN),
        points=points[first_in_voxels(points, 1 / KEPT_VOXEL)],
    )
    return seen.transformed(T_map_camera)


def _with_confidence_updated(
    reading: Reading, points: Points, in_box: NDArray[np.float64], ground: float, policy: ObjectPolicy
) -> tuple[Reading, Mask]:
    """A reading with its confidence updated from its points, and which of the points belong to the object."""
    if not policy.extents:
        return reading, np.zeros(len(points), np.bool_)
    weighed = weigh(policy.extents, points, ground, in_box=in_box)
    return replace(reading, confidence=float(expit(logit(reading.confidence) + weighed.log_ratio))), weighed.belongs


def _outline_mask(frame: Frame, reading: Reading) -> PixelMask:
    """The pixels within a reading's outline."""
    mask = np.zeros(frame.depth.shape, np.uint8)
    outline = cv2.convexHull(reading.corners.astype(np.float32) - np.float32(0.5))
    cv2.fillConvexPoly(mask, np.round(outline).astype(np.int32), 1)
    return mask.astype(np.bool_)
