"""What a depth camera can measure: every range, noise and angle of the camera follows from it."""

from dataclasses import dataclass
from math import radians
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Depth = TypeVar("Depth", float, NDArray[np.floating])


@dataclass(frozen=True)
class SensorModel:
    """A depth camera; its field of view follows from the :class:`pipeline.frame.Intrinsics`.

    Attributes:
        nearest, farthest: depths between which surfaces give a return, m along the optical axis.
        grazing: least angle between a ray and a surface that surely gives a return, rad.
        margin: m inside of the range at both ends, where returns can be relied on.
        same_surface: share of a return's depth by which the depths of returns beside it on the same surface may
            differ from it.
    """

    nearest: float
    farthest: float
    grazing: float
    margin: float
    same_surface: float = 0.05

    def sigma(self, depth: Depth) -> Depth:
        """m, standard deviation of returns at a depth, m, of structured light (Nguyen et al., 3DIMPVT 2012)."""
        return 0.0012 + 0.0019 * (depth - 0.4) ** 2


XTION = SensorModel(nearest=0.8, farthest=3.5, grazing=radians(8.5), margin=0.1)
"""The ASUS Xtion PRO LIVE: the range is the data sheet's. The margin is five standard deviations at the far end,
where the limit cuts off the far half of the noise. Past 82° of incidence the simulated camera gives no return."""
