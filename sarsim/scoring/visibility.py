"""Which things came into view."""

from collections.abc import Sequence
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from sarsim.sensors.camera import LabelledImage

VISIBLE = 400
"""Number of pixels with a depth within the sensor's range of 3.5 m from which a thing is visible in a frame."""


class HasGeoms(Protocol):
    """What is made of geoms of its own."""

    @property
    def geoms(self) -> NDArray[np.int64]:
        """(N,) their ids."""


class Visibility:
    """Records which things were visible in a frame.

    Attributes:
        visible: (T,) bool, the things that were visible so far.
    """

    def __init__(self, model: mujoco.MjModel, things: Sequence[HasGeoms]):
        """``things``: of the model; no two share a geom."""
        self.visible = np.zeros(len(things), np.bool_)
        # Indexed by geom id; the last element belongs to id -1, no geom.
        self._thing_of_geom = np.full(model.ngeom + 1, len(things))
        for number, thing in enumerate(things):
            self._thing_of_geom[thing.geoms] = number

    def add(self, image: LabelledImage) -> None:
        """Mark what is visible in a noise-free image, clipped to the sensor's range."""
        shown = self._thing_of_geom[image.instance[image.depth > 0]]
        self.visible |= np.bincount(shown, minlength=len(self.visible) + 1)[:-1] >= VISIBLE
