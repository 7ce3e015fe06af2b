"""Estimate the camera's pose above the floor from the first frames of a recording that does not provide it."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Directions, Pose, Values
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.localisation.localisation import LostError
from pipeline.localisation.registration import front_normals
from pipeline.localisation.vertical import T_level_camera, vertical
from pipeline.transforms import inverse

MAX_FRAMES, MAX_VIEWS = 30, 8  # Maximum numbers of frames and of views if any of them shows the vertical
MIN_TRANSLATION, MIN_ROTATION = (0.1, 0.1)  # m or rad, minimum motion since the last view for a new view
MIN_UPWARD_COS = np.cos(np.radians(45))
"""Minimum cosine of the angle between the vertical and the image's upward direction."""
MIN_LEVEL_COS, MAX_UPRIGHT_COS = np.cos(np.radians(4)), np.sin(np.radians(4))
"""Limits of the cosine of the angle between the vertical and the normals of level and upright surfaces: 4° of
tolerance."""
MAX_CANDIDATES = 200  # Maximum number of normals of nearly level surfaces that are tried as the vertical
SAME_DIRECTION_COS = np.cos(np.radians(6))  # Cosine of the angle beyond which two directions are different candidates
MIN_OTHER_SUPPORT = 0.7
"""Minimum support of another direction that may be the vertical, as a fraction of the largest support."""
LAYER_THICKNESS = 0.05  # m, thickness of the layers in which level surfaces are counted
MIN_FLOOR_FRACTION = 0.25
"""Minimum number of points in the floor's layer, as a fraction of the number in the largest layer."""


class CameraPoseEstimate(NamedTuple):
    """An estimated pose of a camera above the floor.

    Attributes:
        T_level_camera: pose of ``camera_optical`` above the floor, see
            :func:`~pipeline.localisation.vertical.T_level_camera`.
        other: pose above another surface that may be the floor; None if there is no such surface.
    """

    T_level_camera: Pose
    other: Pose | None


class _Surfaces(NamedTuple):
    """Points (N, 3) m and normals (N, 3) of the surfaces in view, in ``camera_optical`` of the first frame."""

    points: NDArray[np.float64]
    normals: Directions


def find_pose_above_floor(
    frames: Iterator[Frame], pose: Callable[[Frame], Pose | None], config: LocalisationConfig
) -> CameraPoseEstimate | None:
    """The pose of the first frame's camera above the floor; None if no frame shows the vertical.

    The support of a direction is the number of points on surfaces that are level or upright if the direction is the
    vertical. In front of a ramp, the walls or surfaces seen later therefore decide between the ramp and the floor.

    Args:
        frames: frames of a recording, of which the first has depth returns.
        pose: returns the pose of a frame's camera in a coordinate frame that all frames share; None if unknown.
        config: parameters of the localisation.
    """
    seen, candidates = _seen(frames, pose, config)
    if seen is None or not candidates:
        return None
    level = seen.normals[-seen.normals[:, 1] > MIN_UPWARD_COS]
    drawn = level[np.random.default_rng(0).permutation(len(level))[:MAX_CANDIDATES]]
    ups = np.concatenate([np.array(candidates), drawn])
    support = np.array([_support(seen.normals, up) for up in ups])
    up = _refined(seen.normals, ups[support.argmax()])
    apart = ups @ up < SAME_DIRECTION_COS
    second = np.where(apart, support, 0)
    T = T_level_camera(up, _floor(seen, up))
    if second.max(initial=0) < MIN_OTHER_SUPPORT * support.max():
        return CameraPoseEstimate(T, None)
    other = _refined(seen.normals, ups[second.argmax()])
    return CameraPoseEstimate(T, T_level_camera(other, _floor(seen, other)))


def _seen(
    frames: Iterator[Frame], pose: Callable[[Frame], Pose | None], config: LocalisationConfig
) -> tuple[_Surfaces | None, list[Direction]]:
    """The surfaces in the first frames, and the verticals that they show, in the first frame's ``camera_optical``."""
    first: Pose | None = None
    last: Pose | None = None
    points, normals, ups = list[NDArray[np.float64]](), list[Directions](), list[Direction]()
    with suppress(LostError, InputError):  # Errors in the recording are reported when its frames are mapped
        for number, frame in enumerate(frames):
            placed = pose(frame)
            if placed is None:
                continue
            first = placed if first is None else first
            T = inverse(first) @ placed
            if ups and (number >= MAX_FRAMES or len(points) >= MAX_VIEWS):
                break
            if last is not None and _is_near(T, last):
                continue
            cloud, up = cloud_of_frame(frame, config.registration), vertical(frame, config)
            if cloud is None:
                continue
            last = T
            points.append(cloud.points()[:, :3] @ T[:3, :3].T + T[:3, 3])
            normals.append(front_normals(cloud, frame.T_base_camera[:3, 3]) @ T[:3, :3].T)
            ups += [] if up is None else [T[:3, :3] @ up]
    return (_Surfaces(np.concatenate(points), np.concatenate(normals)) if points else None), ups


def _is_near(T: Pose, other: Pose) -> bool:
    turned = np.arccos(np.clip((np.trace(T[:3, :3].T @ other[:3, :3]) - 1) / 2, -1, 1))
    return bool(np.linalg.norm(T[:3, 3] - other[:3, 3]) < MIN_TRANSLATION and turned < MIN_ROTATION)


def _support(normals: Directions, up: Direction) -> int:
    """Number of points on surfaces that are level or upright if ``up`` is the vertical."""
    along = normals @ up
    return int(np.count_nonzero(along > MIN_LEVEL_COS) + np.count_nonzero(np.abs(along) < MAX_UPRIGHT_COS))


def _refined(normals: Directions, up: Direction) -> Direction:
    """The vertical relative to which the surfaces that support ``up`` are closest to level or upright."""
    along = normals @ up
    level, upright = normals[along > MIN_LEVEL_COS], normals[np.abs(along) < MAX_UPRIGHT_COS]
    _, directions = np.linalg.eigh(upright.T @ upright - level.T @ level)
    return directions[:, 0] * np.sign(directions[:, 0] @ up)


def _floor(seen: _Surfaces, up: Direction) -> float:
    """Coordinate along ``up``, m, of the lowest large level surface, or of the lowest points if there is none."""
    heights: Values = seen.points @ up
    level = np.sort(heights[seen.normals @ up > MIN_LEVEL_COS])
    if not len(level):
        return float(np.quantile(heights, 0.02))
    layer = np.searchsorted(level, level + LAYER_THICKNESS) - np.arange(len(level))  # points in the layer above each
    lowest = int(np.argmax(layer >= MIN_FLOOR_FRACTION * layer.max()))
    first = level[lowest : lowest + layer[lowest]]
    around = level[np.abs(level - np.median(first)) < LAYER_THICKNESS]
    return float(np.median(around))
