"""Which objects came into view."""

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np

from pipeline.arrays import Indices
from sarsim.sensors.camera import LabelledImage

VISIBLE = 400
"""Number of pixels with a depth within the sensor's range of 3.5 m from which an object is visible in a frame."""


class HasGeoms(Protocol):
    """What is made of geoms of its own."""

    @property
    def geoms(self) -> Indices:
        """Their ids."""


class Visibility:
    """Records which objects were visible in a frame.

    Attributes:
        visible: (T,) bool, the objects that were visible so far.
    """

    def __init__(self, model: mujoco.MjModel, objects: Sequence[HasGeoms]):
        """``objects``: of the model; no two share a geom."""
        self.visible = np.zeros(len(objects), np.bool_)
        # Indexed by geom id; the last element belongs to id -1, no geom.
        self._object_of_geom = np.full(model.ngeom + 1, len(objects))
        for number, one in enumerate(objects):
            self._object_of_geom[one.geoms] = number

    def add(self, image: LabelledImage) -> None:
        """Mark what is visible in a noise-free image, clipped to the sensor's range."""
        shown = self._object_of_geom[image.instance[image.depth > 0]]
        self.visible |= np.bincount(shown, minlength=len(self.visible) + 1)[:-1] >= VISIBLE
