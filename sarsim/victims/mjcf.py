"""Numbers, geoms and rotations in MJCF's format."""

from collections.abc import Iterable
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rotation3
from pipeline.labels import Label


def numbers(values: float | Iterable[float] | NDArray[np.floating], decimals: int = 4) -> str:
    """A number or (N,) numbers as text, rounded to a number of decimals."""
    return " ".join(
        f"{value:.{decimals}f}".rstrip("0").rstrip(".") for value in np.ravel(np.asarray(values, np.float64))
    )


def geom(name: str, label: Label, **attributes: str | int | Iterable[float] | NDArray[np.floating]) -> Element:
    """A geom with a label; attributes are strings, numbers, or (N,) numbers."""
    words = {key: value if isinstance(value, str) else numbers(value) for key, value in attributes.items()}
    return Element("geom", {"name": name, "user": str(int(label)), **words})


def about_z(yaw: float) -> Rotation3:
    """Rotation about z by ``yaw``, rad."""
    return np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])


def quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4,) unit quaternion w x y z of a (3, 3) rotation."""
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, rotation.ravel())
    return quat
