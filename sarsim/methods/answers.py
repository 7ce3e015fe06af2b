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
from pipeline.transforms import POSE, are_poses
from pipeline.victims.detection.detection import Detection


def one_line(error: BaseException) -> str:
    """Type and message of an error, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _check_viewpoint(answer: Any, name: str, context: Context) -> None:
    """Allow a viewpoint that can be reached, or None."""
    if answer is None:
        return
    if not isinstance(answer, Viewpoint):
        raise InputError(f"{name} must return a Viewpoint or None, not {kind_of(answer)}")
    _check_array(answer.position, (2,), f"{name}: the viewpoint's position")
    _check_number(answer.heading, f"{name}: the viewpoint's heading")
    if context.paths.start is not None and (obstacle := obstacle_to(context.paths, answer.position)):
        raise InputError(f"{name}: {obstacle}")


def _check_probabilities(answer: Any, name: str, frame: object, points: Any, T_map_camera: object) -> None:
    """Allow (N, 8) class probabilities of N points."""
    _check_array(answer, (len(points), len(Label)), f"{name}: the probabilities")
    if (answer < 0).any():
        raise InputError(f"{name}: the probabilities must be non-negative, but one is {answer.min():g}")
    if not np.allclose(sums := answer.sum(axis=1), 1, atol=1e-3):
        worst = sums[np.abs(sums - 1).argmax()]
        raise InputError(f"{name}: the probabilities of each point must sum to 1, but one sum is {worst:g}")


def _check_detections(answer: Any, name: str, rgb: object) -> None:
    """Allow a list of detections of kinds that the robot searches for."""
    _check_list(answer, name, Detection)
    for one in answer:
        box = np.asarray(one.box)
        if not np.issubdtype(box.dtype, np.number) or box.shape != (4,) or not np.isfinite(box).all():
            raise InputError(f"{name}: a box must be four finite numbers (x0, y0, x1, y1), not {box.tolist()!s:.60}")
        if one.kind not in KINDS:
            known = f"{', '.join(KINDS[:-1])} or {KINDS[-1]}"
            raise InputError(f"{name}: the kind of a detection must be {known}, not {one.kind!r}")
        if not 0 <= one.confidence <= 1:
            raise InputError(f"{name}: the confidence of a detection must be from 0 to 1, not {one.confidence}")


def _check_readings(answer: Any, name: str, frame: Frame, detections: object) -> None:
    """Allow a list of readings whose outlines lie in the image."""
    _check_list(answer, name, Reading)
    for one in answer:
        if not (isinstance(one.kind, str) and is_find_kind(one.kind)):
            raise InputError(
                f"{name}: the kind of a reading must be a name other than victim, such as red_square "
                f"(1 to 40 of a-z, 0-9 and _, first a letter), not {one.kind!r}"
            )
        if not isinstance(one.text, str):
            raise InputError(f"{name}: the text of a reading must be a string, not {kind_of(one.text)}")
        _check_number(one.confidence, f"{name}: the confidence of a reading")
        if not 0 <= one.confidence <= 1:
            raise InputError(f"{name}: the confidence of a reading must be from 0 to 1, not {one.confidence}")
        corners, size = f"{name}: the corners of a reading", frame.rgb.shape[1::-1]
        least = max(3, len(np.atleast_1d(one.corners)))
        _check_array(one.corners, (least, 2), corners, "(N, 2) with N at least 3")
        if one.corners.dtype != np.float32:
            raise InputError(f"{corners} must have dtype float32, not {one.corners.dtype}")
        is_outside = ((one.corners < 0) | (one.corners > size)).any(axis=1)
        if is_outside.any():
            (x, y), (width, height) = one.corners[is_outside][0], size
            raise InputError(
                f"{corners} must lie inside the image, from (0, 0) to ({width}, {height}), not at ({x:g}, {y:g})"
            )
        if not one.side:
            raise InputError(f"{corners} must differ in both x and y, so that they enclose an area")


def _check_localised(answer: Any, name: str, frame: object) -> None:
    if not isinstance(answer, Localised):
        raise InputError(f"{name} must return a Localised, not {kind_of(answer)}")
    if np.shape(answer.T_map_base) != (4, 4):
        raise InputError(f"{name}: T_map_base must be an array of shape (4, 4), not {kind_of(answer.T_map_base)}")
    if not are_poses(answer.T_map_base):
        raise InputError(f"{name}: T_map_base must be {POSE}")


def check_poses(answer: Any, where: str) -> None:
    """Allow (1, 4, 4) poses after a first keyframe."""
    if np.shape(answer) != (1, 4, 4):
        raise InputError(
            f"{where}: after the first keyframe, poses must be an array of shape (1, 4, 4), not {kind_of(answer)}"
        )
    if not are_poses(answer):
        raise InputError(f"{where}: poses must contain {POSE}")


def _check_plan(answer: Any, name: str, *args: object) -> None:
    """Allow a plan with waypoints, or None."""
    if answer is None:
        return
    if not isinstance(answer, PathPlan):
        raise InputError(f"{name} must return a PathPlan or None, not {kind_of(answer)}")
    count = len(np.atleast_1d(answer.way_points))
    _check_array(answer.way_points, (count, 3), f"{name}: way_points", "(N, 3)")
    if not count:
        raise InputError(f"{name}: way_points must contain at least one waypoint; return None if there is no path")
    if (shape := np.shape(answer.backwards)) != (count,):
        raise InputError(f"{name}: backwards must have shape ({count},), one flag per waypoint, not {shape}")


CHECKS: Mapping[str, Callable[..., None]] = {
    "next_viewpoint": _check_viewpoint,
    "classify": _check_probabilities,
    "detect": _check_detections,
    "read": _check_readings,
    "localise": _check_localised,
    "plan": _check_plan,
}
"""Checks by method name; they get the return value, the beginning of the error line, and the method's arguments."""


def _check_list(answer: Any, name: str, kind: type) -> None:
    """Allow a list of objects of a class."""
    wanted = f"{name} must return a list of {kind.__name__} objects"
    if not isinstance(answer, list):
        raise InputError(f"{wanted}, not {kind_of(answer)}")
    if others := [one for one in answer if not isinstance(one, kind)]:
        raise InputError(f"{wanted}, but the list contains {kind_of(others[0])}")


def _check_number(value: Any, what: str) -> None:
    """Allow a finite number."""
    if not np.issubdtype(np.asarray(value).dtype, np.number) or np.shape(value) != ():
        raise InputError(f"{what} must be a number, not {kind_of(value)}")
    if not np.isfinite(value):
        raise InputError(f"{what} must be finite, not {value}")


def _check_array(value: Any, shape: tuple[int, ...], what: str, wanted: str = "") -> None:
    """Allow an array of finite numbers of a given shape, called ``wanted`` in the error."""
    if not isinstance(value, np.ndarray) or not np.issubdtype(value.dtype, np.number) or value.shape != shape:
        raise InputError(f"{what} must be a numeric array of shape {wanted or shape}, not {kind_of(value)}")
    if not np.isfinite(value).all():
        raise InputError(f"{what} must not contain NaN or infinite values")


def kind_of(value: Any) -> str:
    """The type of a value and, for an array, its shape."""
    if value is None:
        return "None"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and dtype {value.dtype}"
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'aeiouAEIO' else 'a'} {kind}"
