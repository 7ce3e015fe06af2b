"""The numbers of the metric map."""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.files import MOST_MEMORY
from pipeline.sensor import XTION
from pipeline.transforms import FARTHEST


@dataclass(frozen=True)
class IsolatedReturnsConfig:
    """Which returns of a depth image stand alone, as specks of dust, rain or snow in the air do.

    Of a surface of which dust hides four fifths, 93 % of the returns remain; of specks that fill 2 % of the image,
    one in 2000.

    Attributes:
        reach: pixels to a return's farthest neighbours.
        fewest_alike: how many of these must have a similar depth.
    """

    reach: int = 2
    fewest_alike: int = 2


@dataclass(frozen=True)
class MetricMapConfig:
    """The voxels, and how rays fill and free them.

    Attributes:
        voxel_size: m.
        max_range: m; the ray of a farther return frees space up to here and has no end point. Measured along the
            optical axis for depth images, from the origin for points.
        margin: m before its end point at which a ray stops freeing space, so that noise does not free the voxels of
            the surface.
        offset: (x, y, z) of a voxel's corner in ``map``, in voxels. Built surfaces tend to lie at round coordinates,
            and noise spreads a surface on the face between two voxel layers over both. So z = 0 and all multiples of
            half a voxel along every axis lie inside a layer.
        hit: what an end point adds to a voxel's value; one return proves a surface.
        miss: what a crossing ray subtracts; rays cross a voxel that has a surface in one corner again and again.
        greatest: value of a voxel; a vanished surface is erased after ``greatest`` / ``miss`` frames.
        narrow: depth in voxels up to which the field of view is so narrow that it passes between the corners of
            voxels, so that rays are traced there.
        max_bytes: the most memory that the voxels may take.
        isolated_returns: of depth images, which are left out.

    Raises:
        InputError: a value is out of its range; the message names it.
    """

    voxel_size: float = 0.1
    max_range: float = XTION.farthest
    margin: float = 0.03
    offset: tuple[float, float, float] = (-0.25, -0.25, -0.4)
    hit: int = 10
    miss: int = 1
    greatest: int = 40
    narrow: float = 6.0
    max_bytes: int = MOST_MEMORY
    isolated_returns: IsolatedReturnsConfig = IsolatedReturnsConfig()

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.max_range <= FARTHEST:
            raise InputError(f"metric map: max_range must be at most {FARTHEST:.0f} m, got {self.max_range}")
        if not 1e-3 <= self.voxel_size <= self.max_range:
            span = f"from 1 mm to the range of {self.max_range:g} m"
            raise InputError(f"metric map: voxel_size must be {span}, got {self.voxel_size:g}")
        if not 0 <= self.margin < np.inf:
            raise InputError(f"metric map: margin must not be negative, got {self.margin}")
        if np.shape(self.offset) != (3,) or not np.isfinite(self.offset).all():
            raise InputError(f"metric map: offset must be three numbers, got {self.offset}")
        if not 0 < self.miss < self.hit <= self.greatest <= np.iinfo(np.int8).max:
            values = f"{self.miss}, {self.hit} and {self.greatest}"
            raise InputError(f"metric map: miss, hit and greatest must increase within 1 to 127, got {values}")
        if not isinstance(self.max_bytes, int) or self.max_bytes <= 0:
            raise InputError(f"metric map: max_bytes must be a positive whole number, got {self.max_bytes}")

    @property
    def least(self) -> int:
        """Value of a voxel; one hit outweighs it."""
        return self.miss - self.hit
