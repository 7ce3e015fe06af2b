"""Records which objects came into view."""

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np

from pipeline.arrays import Indices
from sarsim.sensors.camera import LabelledImage

MIN_VISIBLE_PIXELS = 400
"""Minimum number of pixels with a noise-free return for an object to be visible in a frame."""


class HasGeoms(Protocol):
    """An object with geoms of its own."""

    @property
    def geoms(self) -> Indices:
        """Ids of the geoms."""


class Visibility:
    """Records which objects have been visible in a frame.

    Attributes:
        visible: (T,) bool, whether each object has been visible so far.
    """

    def __init__(self, model: mujoco.MjModel, objects: Sequence[HasGeoms]):
        """``objects``: objects in the model, no two of which share a geom."""
        self.visible = np.zeros(len(objects), np.bool_)
        # Indexed by geom id; the last element belongs to id -1, no geom.
        self._object_of_geom = np.full(model.ngeom + 1, len(objects))
        for number, one in enumerate(objects):
            self._object_of_geom[one.geoms] = number

    def add(self, image: LabelledImage) -> None:
        """Mark the objects visible in a noise-free image, which has depth only where there is a return."""
        shown = self._object_of_geom[image.instance[image.depth > 0]]
        self.visible |= np.bincount(shown, minlength=len(self.visible) + 1)[:-1] >= MIN_VISIBLE_PIXELS
