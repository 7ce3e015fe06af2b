"""A detection and its depth: where in ``map`` the person is, or why it is none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.transforms import transform_points
from pipeline.victim_detection.detection import Detection


@dataclass(frozen=True)
class ObservationConfig:
    """Settings of what counts as a person.

    Attributes:
        min_returns: share of a box's pixels that must have a depth.
        margin: around the box, in which the background is looked for, as a share of its size.
        min_plane: share of that margin's points that a background plane must have.
        planes: of background, at most: floor and wall.
        trials: to find each of them.
        tolerance: m from a plane within which a point belongs to it, over twice the sensor's noise.
        min_relief: share of a box's returns that must stand out of the background.
        min_size: m; a person, or the head of one, is not smaller.
        max_size: m; nor larger.
        depth_reach: m before and behind the middle of what stands out that still is the person.
        skin_to_middle: m, standard deviation of what is seen from the middle of the body.
        seed: of the trials.
    """

    min_returns: float = 0.2
    margin: float = 0.3
    min_plane: float = 0.2
    planes: int = 2
    trials: int = 60
    tolerance: float = 0.015
    min_relief: float = 0.1
    min_size: float = 0.18
    max_size: float = 2.3
    depth_reach: float = 0.8
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
    inside, around = _windows(frame, detection, config.margin)
    returns = frame.returns & inside
    if returns.sum() < max(1, config.min_returns * inside.sum()):
        return Refusal(detection, "no depth where it is")
    points = frame.intrinsics.rays[returns] * frame.depth[returns, None]
    background = frame.intrinsics.rays[around & frame.returns] * frame.depth[around & frame.returns, None]
    person = points[_stands_out(points, background, config)]
    if len(person) < config.min_relief * len(points):
        return Refusal(detection, "flat: nothing stands out of the plane around it, as of a picture")
    person = person[np.abs(person[:, 2] - np.median(person[:, 2])) < config.depth_reach]
    size = float(np.linalg.norm(np.subtract(*np.percentile(person, [95, 5], axis=0))))
    if not config.min_size <= size <= config.max_size:
        return Refusal(
            detection, f"{size:.2f} m: {'less' if size < config.min_size else 'more'} than a person"
        )
    return _observation(detection, transform_points(T_map_camera, person), T_map_camera, config)


def depth_noise(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """m, standard deviation of a return (Nguyen, Izadi and Lovell, 3DIMPVT 2012)."""
    return 0.0012 + 0.0019 * np.square(depth - 0.4)


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
    return np.percentile(points, [3, 97], axis=0).mean(axis=0)


def _windows(
    frame: Frame, detection: Detection, margin: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(H, W) bool: the pixels of the box, and those around it."""
    x0, y0, x1, y1 = detection.box
    u, v = np.arange(frame.intrinsics.width) + 0.5, np.arange(frame.intrinsics.height) + 0.5

    def window(share: float) -> NDArray[np.bool_]:
        dx, dy = share * (x1 - x0), share * (y1 - y0)
        columns = (u >= x0 - dx) & (u <= x1 + dx)
        return ((v >= y0 - dy) & (v <= y1 + dy))[:, None] & columns

    return window(0), window(margin) & ~window(margin / 10)


def _stands_out(
    points: NDArray[np.float32], background: NDArray[np.float32], config: ObservationConfig
) -> NDArray[np.bool_]:
    """(N,) bool: the points that lie in no plane of the background."""
    rng = np.random.default_rng(config.seed)
    result = np.ones(len(points), np.bool_)
    enough = max(3, config.min_plane * len(background))
    for _ in range(config.planes):
        if len(background) < enough:
            break
        plane = _plane(background, config, rng)
        near = _near(background, plane, config)
        if near.sum() < enough:
            break
        result &= ~_near(points, plane, config)
        background = background[~near]
    return result


def _plane(
    points: NDArray[np.float32], config: ObservationConfig, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(4,) unit normal and offset of the plane with most of the points near it, by RANSAC."""
    triples = points[rng.integers(len(points), size=(config.trials, 3))].astype(np.float64)
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.maximum(lengths, 1e-12)
    planes = np.concatenate([normals, -np.sum(normals * triples[:, 0], axis=1, keepdims=True)], axis=1)
    few = points[:: 1 + len(points) // 500]
    counts = [_near(few, plane, config).sum() if plane.any() else 0 for plane in planes]
    return planes[int(np.argmax(counts))]


def _near(
    points: NDArray[np.float32], plane: NDArray[np.float64], config: ObservationConfig
) -> NDArray[np.bool_]:
    distance = np.abs(points @ plane[:3] + plane[3])
    return distance < config.tolerance + 2 * depth_noise(points[:, 2])
