"""Scores whether the robot has found the victims.

A victim's position is the centre of the bounding box of the whole person in its own frame, including hidden parts
(:attr:`sarsim.victims.victims.TrueVictim.centre`). Positions that the robot confirmed are matched with victims within
``MAX_MATCH_DISTANCE``, one to one, so that a person reported twice is one victim found and one false alarm.
"""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.arrays import Mask, Places, Values
from sarsim.scoring.visibility import Visibility
from sarsim.sensors.camera import LabelledImage
from sarsim.victims.victims import victims_of

MAX_MATCH_DISTANCE = 0.5  # m; a victim has been found if a confirmed position is at most this far away
UNMATCHED_COST = 1e3  # Replaces infinite costs; greater than the sum of all finite ones


def min_cost_pairs(cost: NDArray[np.float64]) -> list[tuple[int, int]]:
    """As many one-to-one (row, column) pairs of finite cost (N, M) as possible, with the minimum total cost."""
    # linear_sum_assignment fails if infinite costs rule out a complete assignment.
    rows, columns = linear_sum_assignment(np.where(np.isfinite(cost), cost, UNMATCHED_COST))
    return [(int(i), int(k)) for i, k in zip(rows, columns, strict=True) if np.isfinite(cost[i, k])]


class VictimScore:
    """Records which victims come into view, and compares the confirmed positions with the true ones.

    Attributes:
        positions: (V, 3) true positions, m in ``world``.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        victims = victims_of(model, data)
        self.positions = np.array([victim.centre for victim in victims]).reshape(-1, 3)
        self._visibility = Visibility(model, victims)

    @property
    def visible(self) -> Mask:
        """(V,) bool, whether each victim has been visible in a frame so far."""
        return self._visibility.visible

    def add(self, image: LabelledImage) -> None:
        """Mark the victims in a noise-free image, which has depth only where there is a return."""
        self._visibility.add(image)

    def matches(self, confirmed: Places) -> Values:
        """(V,) m, distance from each victim to the confirmed position matched with it; NaN without a match."""
        distance = np.linalg.norm(self.positions[:, None] - confirmed.reshape(1, -1, 3), axis=2)
        found = np.full(len(self.positions), np.nan)
        for i, k in min_cost_pairs(np.where(distance <= MAX_MATCH_DISTANCE, distance, np.inf)):
            found[i] = distance[i, k]
        return found

    def report(self, confirmed: Places) -> dict[str, Any]:
        """Figures of the confirmed positions; ``position_error_m`` is the median, None if no victim was found."""
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
