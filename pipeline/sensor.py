"""The measuring limits of a depth camera, from which all ranges, noise and angles in the pipeline follow."""

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
        grazing: smallest angle between ray and surface at which a return is certain, rad.
        margin: width of the bands at both ends of the range in which returns are unreliable, m.
        same_surface: greatest difference in depth between neighbouring returns on one surface, as a share of depth.
    """

    nearest: float
    farthest: float
    grazing: float
    margin: float
    same_surface: float = 0.05

    def sigma(self, depth: Depth) -> Depth:
        """Standard deviation at a depth, both m, of a structured-light camera (Nguyen et al., 3DIMPVT 2012)."""
        return 0.0012 + 0.0019 * (depth - 0.4) ** 2


XTION = SensorModel(nearest=0.8, farthest=3.5, grazing=radians(8.5), margin=0.1)
"""The ASUS Xtion PRO LIVE: the range is the data sheet's. The margin is five standard deviations at the far end,
where the limit cuts off half of the noise. Beyond 82° of incidence the simulated camera gives no return."""
