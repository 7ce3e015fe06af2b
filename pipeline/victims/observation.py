"""Turns a detection and its depth into the person's position in ``map``, or into the reason why it is no person."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.transforms import transform_points
from pipeline.victims.detection.background import background_planes, near_plane
from pipeline.victims.detection.detection import Detection

LEAST_SHARE = 0.05  # Of a box's pixels, that must have a depth, and of these, that must stand out of the background
PERSON_GAP = 0.3  # m of depth between a person and objects in front of or behind the person
MIN_PART = 0.25  # The person is the nearest part with at least this share of the points that stand out
MIN_SIZE, MAX_SIZE = 0.15, 2.3  # m across a person, or across the head of one
SKIN_TO_MIDDLE = 0.08  # m, standard deviation due to the distance from the visible skin to the middle of the body


@dataclass(frozen=True, eq=False)
class PersonObservation:
    """A person, seen in one frame.

    Attributes:
        detection: in the image.
        points: (N, 3) float32 the person's visible points, m in ``map``.
        position: (3,) float64 middle of the points.
        covariance: (3, 3) float64 of the position, m².
        camera: (3,) float64 position of the camera.
    """

    detection: Detection
    points: NDArray[np.float32]
    position: NDArray[np.float64]
    covariance: NDArray[np.float64]
    camera: NDArray[np.float64]


@dataclass(frozen=True)
class Refusal:
    """A detection that is no person, and the reason."""

    detection: Detection
    reason: str


def observe(frame: Frame, detection: Detection, T_map_camera: NDArray[np.float64]) -> PersonObservation | Refusal:
    """Observe the person of a detection by the frame's depth, or refuse the detection.

    Args:
        frame: with its depth.
        detection: in its image.
        T_map_camera: 4×4 pose of ``camera_optical`` in ``map``.
    """
    inside = _window(frame, detection)
    returns = frame.returns & inside
    if returns.sum() < max(1, LEAST_SHARE * inside.sum()):
        return Refusal(detection, "no depth where it is")
    points = frame.intrinsics.rays[returns] * frame.depth[returns, None]
    person = points[_stands_out(frame, detection, points)]
    if len(person) < LEAST_SHARE * len(points):
        return Refusal(detection, "flat: nothing stands out of the plane around it, as of a picture")
    person = _nearest_part(person)
    person = person[np.linalg.norm(person - np.median(person, axis=0), axis=1) < MAX_SIZE / 2]
    size = size_of(person)
    if not MIN_SIZE <= size <= MAX_SIZE:
        return Refusal(detection, f"{size:.2f} m: {'less' if size < MIN_SIZE else 'more'} than a person")
    points = transform_points(T_map_camera, person)
    # The middle's standard deviation is half that of the points, because parts of the person may be hidden.
    spread = np.cov(points.T.astype(np.float64)) / 2**2 + np.eye(3) * SKIN_TO_MIDDLE**2
    return PersonObservation(detection, points, middle(points), spread, T_map_camera[:3, 3])


def middle(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3,) middle, m, of a box around (N, 3) points without the outermost 2 % at each end of each axis."""
    return np.percentile(points, [2, 98], axis=0).mean(axis=0)


def size_of(points: NDArray[np.floating]) -> float:
    """Diagonal, m, of a box around (N, 3) points without the outermost 5 % at each end of each axis."""
    return float(np.linalg.norm(np.subtract(*np.percentile(points, [95, 5], axis=0))))


def _window(frame: Frame, detection: Detection) -> NDArray[np.bool_]:
    """(H, W) bool: the pixels of the box."""
    x0, y0, x1, y1 = detection.box
    u, v = np.arange(frame.intrinsics.width) + 0.5, np.arange(frame.intrinsics.height) + 0.5
    return ((v >= y0) & (v <= y1))[:, None] & (u >= x0) & (u <= x1)


def _stands_out(frame: Frame, detection: Detection, points: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(N,) bool: the points in the box that lie on no plane of the background."""
    result = np.ones(len(points), np.bool_)
    for plane in background_planes(frame, detection.box, np.random.default_rng(0)):
        result &= ~near_plane(points, plane, frame.sensor)
    return result


def _nearest_part(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """The (M, 3) points of the nearest large enough part, where gaps in depth separate the parts."""
    order = np.argsort(points[:, 2], kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(points[order, 2]) > PERSON_GAP) + 1)
    large = [part for part in parts if len(part) >= MIN_PART * len(points)]
    return points[np.sort(large[0] if large else max(parts, key=len))]
