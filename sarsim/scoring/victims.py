"""Whether the robot has found the victims.

A victim's position is the middle of the box around the whole person in its own frame, hidden parts included
(:attr:`sarsim.victims.victims.Victim.centre`). One that the robot confirmed is of the victim next to it, within
``NEAR``, each of one only: a person reported twice is found once, and a false alarm once.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from sarsim.sensors.camera import LabelledImage
from sarsim.victims.victims import victims_of

NEAR = 0.5  # m from the true position within which a victim counts as found
VISIBLE = 400
"""Pixels, with a depth within the sensor's range of 3.5 m, that make a person visible in a frame."""


class VictimScore:
    """Watches which victims come into view, and compares.

    Attributes:
        positions: (V, 3) the true ones, m in the world.
        visible: (V,) bool, who was visible in a frame so far.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        victims = victims_of(model, data)
        self.positions = np.array([victim.centre for victim in victims]).reshape(-1, 3)
        self.visible = np.zeros(len(victims), np.bool_)
        # Indexed by geom id; the last element is what -1, no geom, stands for.
        self._victim_of_geom = np.full(model.ngeom + 1, len(victims))
        for number, victim in enumerate(victims):
            self._victim_of_geom[victim.geoms] = number

    def add(self, image: LabelledImage) -> None:
        """Take a noise-free image, clipped to the sensor's range, into account."""
        shown = self._victim_of_geom[image.instance[image.depth > 0]]
        pixels = np.bincount(shown, minlength=len(self.visible) + 1)[:-1]
        self.visible |= pixels >= VISIBLE

    def matches(self, confirmed: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V,) m from each victim to the one of the confirmed positions (N, 3) that is of it; NaN if none is."""
        distance = np.linalg.norm(self.positions[:, None] - confirmed.reshape(1, -1, 3), axis=2)
        # As many as possible, and of all ways to do that the nearest.
        rows, columns = linear_sum_assignment(np.where(distance <= NEAR, distance, 1e3))
        found = np.full(len(self.positions), np.nan)
        found[rows] = np.where(distance[rows, columns] <= NEAR, distance[rows, columns], np.nan)
        return found

    def report(self, confirmed: NDArray[np.float64]) -> dict[str, Any]:
        """Of the confirmed positions (N, 3), m; ``position_error_m`` is the median, null where no one was found."""
        errors = self.matches(confirmed)
        found = np.isfinite(errors)
        return {
            "present": len(self.positions),
            "found": int(found.sum()),
            "false_alarms": int(len(confirmed) - found.sum()),
            "position_error_m": float(np.median(errors[found])) if found.any() else None,
            "visible": int(self.visible.sum()),
            "visible_found": int((self.visible & found).sum()),
        }
