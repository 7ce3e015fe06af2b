"""Checks of the return values of user-defined methods; InputError, in one line, for invalid ones."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.localisation.localisation import Localised
from pipeline.planning.path_plan import PathPlan, obstacle_to
from pipeline.tracks.find import KINDS, Reading, is_find_kind
from pipeline.transforms import are_poses
from pipeline.victims.detection.detection import Detection


def one_line(error: BaseException) -> str:
    """Type and message of an error, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _check_viewpoint(answer: Any, name: str, context: Context) -> None:
    """Allow a viewpoint that can be reached, or None."""
    if answer is None:
        return
    if not isinstance(answer, Viewpoint):
        raise InputError(f"{name} must return a Viewpoint or None, not {_kind(answer)}")
    _check_numbers(answer.position, (2,), f"{name}: the viewpoint's position")
    _check_numbers(answer.heading, (), f"{name}: the viewpoint's heading")
    if context.paths.start is not None and (obstacle := obstacle_to(context.paths, answer.position)):
        raise InputError(f"{name}: {obstacle}")


def _check_probabilities(answer: Any, name: str, frame: object, points: Any, T_map_camera: object) -> None:
    """Allow (N, 8) class probabilities of N points."""
    _check_numbers(answer, (len(points), len(Label)), f"{name}: the probabilities")
    if (answer < 0).any() or not np.allclose(answer.sum(axis=1), 1, atol=1e-3):
        raise InputError(f"{name}: the probabilities of a point must not be negative and must sum to 1")


def _check_detections(answer: Any, name: str, rgb: object) -> None:
    """Allow a list of detections of kinds that the robot searches for."""
    if not isinstance(answer, list) or not all(isinstance(one, Detection) for one in answer):
        raise InputError(f"{name} must return a list of Detection, not {_kind(answer)}")
    for one in answer:
        _check_numbers(np.asarray(one.box), (4,), f"{name}: a box")
        if one.kind not in KINDS or not 0 <= one.confidence <= 1:
            raise InputError(
                f"{name}: {one.kind!r} {one.confidence} must be one of {', '.join(KINDS)}, with confidence 0 to 1"
            )


def _check_readings(answer: Any, name: str, frame: Frame, detections: object) -> None:
    """Allow a list of readings whose outlines lie in the image."""
    if not isinstance(answer, list) or not all(isinstance(one, Reading) for one in answer):
        raise InputError(f"{name} must return a list of Reading, not {_kind(answer)}")
    for one in answer:
        if not (isinstance(one.kind, str) and is_find_kind(one.kind) and isinstance(one.text, str)):
            raise InputError(
                f"{name}: the kind {one.kind!r} must be a name such as red_square, and the text a string"
            )
        _check_numbers(one.confidence, (), f"{name}: the confidence")
        corners = f"{name}: the corners"
        _check_numbers(one.corners, (max(3, len(np.atleast_1d(one.corners))), 2), corners)
        is_inside = (one.corners >= 0).all() and (one.corners <= frame.rgb.shape[1::-1]).all()
        if one.corners.dtype != np.float32 or not is_inside or not one.side or not 0 <= one.confidence <= 1:
            raise InputError(f"{corners} must be a float32 outline inside the image, with a confidence from 0 to 1")


def _check_localised(answer: Any, name: str, frame: object) -> None:
    if not isinstance(answer, Localised):
        raise InputError(f"{name} must return a Localised, not {_kind(answer)}")
    if np.shape(answer.T_map_base) != (4, 4) or not are_poses(answer.T_map_base):
        raise InputError(f"{name}: T_map_base must be a pose (4, 4), not {_kind(answer.T_map_base)}")


def check_poses(answer: Any, where: str) -> None:
    """Allow (1, 4, 4) poses after a first keyframe."""
    if np.shape(answer) != (1, 4, 4) or not are_poses(answer):
        raise InputError(f"{where}: after the first keyframe, poses must be one pose (1, 4, 4), not {_kind(answer)}")


def _check_plan(answer: Any, name: str, *args: object) -> None:
    """Allow a plan with waypoints, or None."""
    if answer is None:
        return
    if not isinstance(answer, PathPlan):
        raise InputError(f"{name} must return a PathPlan or None, not {_kind(answer)}")
    count = len(np.atleast_1d(answer.way_points))
    _check_numbers(answer.way_points, (count, 3), f"{name}: the waypoints")
    if np.shape(answer.backwards) != (count,) or not count:
        raise InputError(f"{name}: backwards must have one flag per waypoint, not {_kind(answer.backwards)}")


CHECKS: Mapping[str, Callable[..., None]] = {
    "next_viewpoint": _check_viewpoint,
    "classify": _check_probabilities,
    "detect": _check_detections,
    "read": _check_readings,
    "localise": _check_localised,
    "plan": _check_plan,
}
"""Checks by method name; they get the return value, the beginning of the error line, and the method's arguments."""


def _check_numbers(value: Any, shape: tuple[int, ...], what: str) -> None:
    """Allow finite numbers of a given shape."""
    is_number = np.issubdtype(np.asarray(value).dtype, np.number)
    if not is_number or np.shape(value) != shape or (shape and not isinstance(value, np.ndarray)):
        raise InputError(f"{what} must be {f'an array {shape}' if shape else 'a number'}, not {_kind(value)}")
    if not np.isfinite(value).all():
        raise InputError(f"{what} must be finite")


def _kind(value: Any) -> str:
    """The type of a value and, for an array, its shape."""
    return f"an array {value.shape} of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
