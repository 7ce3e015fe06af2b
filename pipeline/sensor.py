"""The measuring limits of a depth camera, from which all ranges, noise and angles in the pipeline are derived."""

from dataclasses import dataclass, replace
from math import inf, radians, sqrt
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

Depth = TypeVar("Depth", float, NDArray[np.floating])
GRAZING = radians(8.5)  # Beyond an angle of incidence of 82°, the simulated camera gives no return
MAX_PRECISE_NOISE = (
    0.02  # m, noise above which returns degrade registration; the map only needs returns in the right voxel
)
MIN_PRECISE_RANGE = (
    3.5  # m, depth up to which any camera's returns are registered, because rooms often have few nearer surfaces
)
MARGIN = 5.0  # Width of the unreliable bands, in standard deviations of the noise at the far end of the range


class DepthNoise(NamedTuple):
    """How the standard deviation of a camera's noise grows: ``min_sigma + growth * (depth - best_depth) ** 2``.

    Attributes:
        min_sigma: standard deviation at the depth ``best_depth``, m.
        growth: increase with the square of the difference from the depth ``best_depth``, 1/m.
        best_depth: depth with the least noise, m.
    """

    min_sigma: float
    growth: float
    best_depth: float = 0.0


STRUCTURED_LIGHT = DepthNoise(min_sigma=0.0012, growth=0.0019, best_depth=0.4)
"""Kinect and Xtion, whose depth comes from one chip (Nguyen, Izadi & Lovell, 3DIMPVT 2012)."""


@dataclass(frozen=True)
class SensorModel:
    """A depth camera; its field of view follows from the :class:`pipeline.frame.Intrinsics`.

    Attributes:
        nearest, farthest: depths between which surfaces give a return, m along the optical axis.
        min_grazing_angle: smallest angle between ray and surface at which a return is certain, rad.
        margin: width of the bands at both ends of the range in which returns are unreliable, m.
        max_relative_depth_step: maximum difference in depth between neighbouring returns on a surface, as a fraction
            of depth.
        noise: how the noise grows with depth.
    """

    nearest: float
    farthest: float
    min_grazing_angle: float
    margin: float
    max_relative_depth_step: float = 0.05
    noise: DepthNoise = STRUCTURED_LIGHT

    @classmethod
    def with_range(cls, nearest: float, farthest: float, noise: DepthNoise) -> Self:
        """A camera with a given range, m, and noise, which determine the width of its unreliable bands."""
        camera = cls(nearest, farthest, GRAZING, margin=0.0, noise=noise)
        return replace(camera, margin=MARGIN * camera.sigma(farthest))

    def sigma(self, depth: Depth) -> Depth:
        """Standard deviation of the noise at a depth, both m."""
        return self.noise.min_sigma + self.noise.growth * (depth - self.noise.best_depth) ** 2

    @property
    def precise(self) -> Self:
        """The same camera up to the depth at which its noise reaches ``MAX_PRECISE_NOISE``.

        If ``MIN_PRECISE_RANGE`` is farther than this depth, the range ends there. The range never grows.
        """
        min_sigma, growth, best_depth = self.noise
        reached = best_depth + sqrt(max(MAX_PRECISE_NOISE - min_sigma, 0) / growth) if growth else inf
        farthest = max(MIN_PRECISE_RANGE, reached)
        return self if self.farthest <= farthest else self.with_range(self.nearest, farthest, self.noise)

    def in_range(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H, W) depth image, m, in which returns outside the range are 0."""
        return np.where((depth >= self.nearest) & (depth <= self.farthest), depth, np.float32(0))


XTION = SensorModel(nearest=0.8, farthest=3.5, min_grazing_angle=GRAZING, margin=0.1)
"""The simulated ASUS Xtion PRO LIVE, with the range from its data sheet. The margin is five standard deviations at
the far end, rounded."""
