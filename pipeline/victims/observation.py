"""A detection and its depth: where in ``map`` the person is, or why it is none."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.transforms import transform_points
from pipeline.victims.detection.background import BackgroundConfig, background_planes, near_plane
from pipeline.victims.detection.detection import Detection


@dataclass(frozen=True)
class ObservationConfig:
    """Settings of what counts as a person.

    Attributes:
        background: how what is around the person is told apart.
        min_returns: share of a box's pixels that must have a depth.
        min_relief: share of a box's returns that must stand out of the background.
        gap: m of depth between what is before or behind the person and the person.
        min_part: share of what stands out that is enough to be the person; the nearest such part is.
        reach: m around the middle of that part within which all of a person lies.
        min_size: m; a person, or the head of one, is not smaller.
        max_size: m; nor larger.
        skin_to_middle: m from what is seen to the middle of the body, and its standard deviation.
        seed: of the background's planes.
    """

    background: BackgroundConfig = field(default_factory=BackgroundConfig)
    min_returns: float = 0.1
    min_relief: float = 0.05
    gap: float = 0.3
    min_part: float = 0.25
    reach: float = 1.1
    min_size: float = 0.15
    max_size: float = 2.3
    skin_to_middle: float = 0.08
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Observation:
    """A person, seen once.

    Attributes:
        detection: in the image.
        points: (N, 3) float32 what is seen of the person, in ``map``.
        position: (3,) middle of that.
        covariance: (3, 3) of the position, m².
        camera: (3,) where the camera stood.
    """

    detection: Detection
    points: NDArray[np.float32]
    position: NDArray[np.float64]
    covariance: NDArray[np.float64]
    camera: NDArray[np.float64]


@dataclass(frozen=True)
class Refusal:
    """A detection that is no person.

    Attributes:
        detection: in the image.
        reason: why.
    """

    detection: Detection
    reason: str


def observe(
    frame: Frame, detection: Detection, T_map_camera: NDArray[np.float64], config: ObservationConfig
) -> Observation | Refusal:
    """What the depth says of a detection in the frame's image."""
    inside = _window(frame, detection)
    returns = frame.returns & inside
    if returns.sum() < max(1, config.min_returns * inside.sum()):
        return Refusal(detection, "no depth where it is")
    points = frame.intrinsics.rays[returns] * frame.depth[returns, None]
    person = points[_stands_out(frame, detection, points, config)]
    if len(person) < config.min_relief * len(points):
        return Refusal(detection, "flat: nothing stands out of the plane around it, as of a picture")
    person = _nearest_part(person, config)
    person = person[np.linalg.norm(person - np.median(person, axis=0), axis=1) < config.reach]
    size = size_of(person)
    if not config.min_size <= size <= config.max_size:
        return Refusal(
            detection, f"{size:.2f} m: {'less' if size < config.min_size else 'more'} than a person"
        )
    return _observation(detection, transform_points(T_map_camera, person), T_map_camera, config)


def _observation(
    detection: Detection,
    points: NDArray[np.float32],
    T_map_camera: NDArray[np.float64],
    config: ObservationConfig,
) -> Observation:
    """The middle deviates half as much as the points do, for there may be more that is not seen."""
    spread = np.cov(points.T.astype(np.float64)) / 4 + np.eye(3) * config.skin_to_middle**2
    return Observation(detection, points, middle(points), spread, T_map_camera[:3, 3])


def middle(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3,) of a box around (N, 3) points but for a few that lie far out."""
    return np.percentile(points, [2, 98], axis=0).mean(axis=0)


def size_of(points: NDArray[np.floating]) -> float:
    """m across a box around (N, 3) points but for some that lie far out."""
    return float(np.linalg.norm(np.subtract(*np.percentile(points, [95, 5], axis=0))))


def _window(frame: Frame, detection: Detection) -> NDArray[np.bool_]:
    """(H, W) bool: the pixels of the box."""
    x0, y0, x1, y1 = detection.box
    u, v = np.arange(frame.intrinsics.width) + 0.5, np.arange(frame.intrinsics.height) + 0.5
    return ((v >= y0) & (v <= y1))[:, None] & (u >= x0) & (u <= x1)


def _stands_out(
    frame: Frame, detection: Detection, points: NDArray[np.float32], config: ObservationConfig
) -> NDArray[np.bool_]:
    """(N,) bool: the points of the box that lie in no plane of the background."""
    rng = np.random.default_rng(config.seed)
    result = np.ones(len(points), np.bool_)
    for plane in background_planes(frame, detection.box, config.background, rng):
        result &= ~near_plane(points, plane, config.background)
    return result


def _nearest_part(points: NDArray[np.float32], config: ObservationConfig) -> NDArray[np.float32]:
    """The points (M, 3) up to the first gap in depth behind which too few lie before it to be the person."""
    order = np.argsort(points[:, 2], kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(points[order, 2]) > config.gap) + 1)
    large = [part for part in parts if len(part) >= config.min_part * len(points)]
    return points[np.sort(large[0] if large else max(parts, key=len))]
