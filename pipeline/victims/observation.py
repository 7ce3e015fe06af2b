"""Turn a detection and its depth into an observation of a person, or state why the detection is not a person."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Mask, PixelMask, Planes, Points, Pose
from pipeline.frame import Frame
from pipeline.geometry.planes import transform_planes
from pipeline.sensor import SensorModel
from pipeline.tracks.find import VICTIM, Reading, box_corners
from pipeline.tracks.likelihood import extents_of, relative_positions, weigh
from pipeline.tracks.pictures import photo_of
from pipeline.tracks.track import Observation
from pipeline.transforms import inverse, transform_points
from pipeline.victims.background import background_planes, is_near_plane
from pipeline.victims.detection import Detection
from pipeline.victims.people import SKIN_TO_MIDDLE, PeoplePolicy, middle

PHOTO_MARGIN = 0.2
"""Margin of a photo around a person's box, relative to the box's longer side; surroundings help recognition."""

MAX_WALL_TILT = np.deg2rad(10)
"""Maximum tilt of a wall, rad."""


@dataclass(frozen=True)
class Refusal:
    """A rejected detection and the reason."""

    detection: Detection
    reason: str


def observe(
    frame: Frame, detection: Detection, T_map_camera: Pose, keyframe: int = 0, policy: PeoplePolicy = PeoplePolicy()
) -> Observation | Refusal:
    """Locate a detected person in ``map`` with the frame's depth, or reject the detection.

    Args:
        frame: the keyframe's frame, with its depth.
        detection: a detection in the keyframe's image.
        T_map_camera: pose of ``camera_optical``.
        keyframe: index of the keyframe.
        policy: how people are tracked.
    """
    window = _box_pixels(frame, detection)
    returns = frame.returns & window
    if not returns.any():
        return Refusal(detection, "no depth in the box")
    in_camera = frame.intrinsics.rays[returns] * frame.depth[returns, None]
    planes, are_flat = background_planes(frame, detection.box, np.random.default_rng(0))
    is_background = _are_near_planes(in_camera, planes, frame.sensor)
    if is_background.all():
        return Refusal(detection, "flat, like a picture: nothing protrudes from the surface around it")
    points, camera = transform_points(T_map_camera, in_camera), T_map_camera[:3, 3]
    ground = float((T_map_camera @ inverse(frame.T_base_camera))[2, 3])
    weighed = weigh(policy.extents, points, ground, is_background, relative_positions(returns, window))
    person = points[weighed.belongs]
    if weighed.log_ratio <= 0:
        extents = " × ".join(f"{extent:.2f}" for extent in extents_of(person))
        return Refusal(detection, f"{extents} m: more like background than a person")
    # Parts of the person may be hidden, so the middle's standard deviation is half the points' standard deviation.
    spread = np.cov(person.T.astype(np.float64)) / 4 + np.eye(3) * SKIN_TO_MIDDLE**2
    return Observation(
        reading=Reading(VICTIM, "", box_corners(detection.box), detection.confidence),
        keyframe=keyframe,
        position=middle(person),
        information=np.linalg.inv(spread).astype(np.float64),
        camera=camera,
        points=person,
        photo=photo_of(frame.rgb, detection.box, PHOTO_MARGIN),
        time=frame.time,
        # A plane that may belong to the person, such as the back beside a box around a hand, is no wall.
        walls=_walls(transform_planes(T_map_camera, planes[are_flat])),
    )


def _box_pixels(frame: Frame, detection: Detection) -> PixelMask:
    """The pixels in a detection's box."""
    x0, y0, x1, y1 = detection.box
    u, v = np.arange(frame.intrinsics.width) + 0.5, np.arange(frame.intrinsics.height) + 0.5
    return ((v >= y0) & (v <= y1))[:, None] & (u >= x0) & (u <= x1)


def _are_near_planes(points: Points, planes: Planes, sensor: SensorModel) -> Mask:
    """Which points lie on at least one of the planes (P, 4); both are in ``camera_optical``."""
    result = np.zeros(len(points), np.bool_)
    for plane in planes:
        result |= is_near_plane(points, plane, sensor)
    return result


def _walls(planes: Planes) -> Planes:
    """The planes in ``map`` that are vertical within ``MAX_WALL_TILT``."""
    return planes[np.abs(planes[:, 2]) < np.sin(MAX_WALL_TILT)]
