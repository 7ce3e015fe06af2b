"""Reads the numbers and poses in SDF files."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose, Values
from pipeline.errors import InputError
from pipeline.transforms import FARTHEST, from_rotation

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ROTATION_FORMATS = {"euler_rpy": 3, "quat_xyzw": 4}
"""Formats of a rotation, each with its number of values."""


def numbers(text: str | None, count: int, where: str) -> Values:
    """The first ``count`` numbers of a text; InputError, with the location ``where``, if they are invalid."""
    try:
        values = np.array((text or "").split()[:count], np.float64)
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not (np.abs(values) <= FARTHEST).all():
        raise InputError(
            f"{where}: must be {count} number{'s' * (count > 1)} from -{FARTHEST:g} to {FARTHEST:g},"
            f" not {' '.join((text or '').split())[:60]!r}"
        )
    return values


def child_numbers(parent: "Element", tag: str, default: tuple[float, ...], where: str) -> Values:
    """The numbers in a child of an element, as many as in ``default``; ``default`` if there is no such child."""
    child = parent.find(tag)
    return np.array(default, np.float64) if child is None else numbers(child.text, len(default), f"{where}, <{tag}>")


def pose_of(owner: "Element", where: str) -> Pose:
    """The ``<pose>`` of an element, relative to the frame named there; the identity if there is no ``<pose>``.

    The values are x y z in m, followed by a quaternion x y z w or by roll, pitch and yaw. These angles are rotations
    about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll), in rad or, if so marked, in degrees
    (http://sdformat.org/tutorials?tut=specify_pose).
    """
    pose, where = owner.find("pose"), f"{where}, <pose>"
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    style = pose.get("rotation_format", "euler_rpy")
    if style not in ROTATION_FORMATS:
        raise InputError(f"{where}: rotation_format must be {' or '.join(ROTATION_FORMATS)}, not {style[:40]!r}")
    values = numbers(pose.text, 3 + ROTATION_FORMATS[style], where)
    if style == "euler_rpy":
        turn = Rotation.from_euler("xyz", values[3:], degrees=pose.get("degrees") in ("true", "1"))
    elif values[3:].any():
        turn = Rotation.from_quat(values[3:])
    else:
        raise InputError(f"{where}: the quaternion must not be 0 0 0 0")
    return from_rotation(turn.as_matrix(), values[:3])


class Reference(NamedTuple):
    """The frame in which a pose is given.

    Attributes:
        relative_to: name of the frame.
        fallback: name of the frame to use if ``relative_to`` does not exist; empty if ``relative_to`` must exist.
    """

    relative_to: str
    fallback: str = ""


def reference_of(owner: "Element", default: str) -> Reference:
    """The frame in which the pose of an element is given.

    Before SDF 1.7, the attribute ``frame`` names this frame. Gazebo ignores the attribute, so an unknown name is not
    an error.
    """
    pose = owner.find("pose")
    now, before = ("", "") if pose is None else (pose.get("relative_to", ""), pose.get("frame", ""))
    return Reference(now or before or default, default if before and not now else "")


def name_of(element: "Element") -> str:
    """The name of an element, short enough for a message."""
    return " ".join(element.get("name", "").split())[:60]
