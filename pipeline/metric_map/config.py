"""Parameters of the metric map."""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError
from pipeline.files import MAX_MEMORY
from pipeline.sensor import XTION
from pipeline.transforms import FARTHEST


@dataclass(frozen=True)
class MetricMapConfig:
    """Settings of the voxels, and of the rays that fill and free them.

    Attributes:
        voxel_size: side of a voxel, m.
        max_range: maximum range of an end point, m; the ray of a farther return only frees space up to this range.
            The range is measured along the optical axis for depth images, and from the origin for point clouds.
        margin: distance before its end point at which a ray stops freeing space, m, so that noise does not free the
            voxels of the surface.
        offset: (x, y, z) of the corner of voxel (0, 0, 0) in ``map``, voxels. Surfaces of buildings tend to lie at
            round coordinates, and noise would spread a surface between two layers of voxels over both. With this
            offset, z = 0 and all multiples of half a voxel along each axis lie inside a layer.
        hit: amount that an end point adds to a voxel's value; large, because a single return proves a surface.
        miss: amount that a crossing ray subtracts from a voxel's value; small, because many rays cross a voxel with a
            surface in only one corner.
        max_log_odds: maximum value of a voxel; a surface that has vanished is erased after at most
            ``max_log_odds`` / ``miss`` frames that see through it.
        max_bytes: maximum memory of the voxels, bytes.

    Raises:
        InputError: a value is out of its range; the message names it.
    """

    voxel_size: float = 0.1
    max_range: float = XTION.farthest
    margin: float = 0.03
    offset: tuple[float, float, float] = (-0.25, -0.25, -0.4)
    hit: int = 10
    miss: int = 1
    max_log_odds: int = 40
    max_bytes: int = MAX_MEMORY

    def __post_init__(self) -> None:
        """Raise InputError if a value is out of its range."""
        if not 0 < self.max_range <= FARTHEST:
            raise InputError(f"metric_map.max_range = {self.max_range}: must be above 0 and at most {FARTHEST:.0f} m")
        if not 1e-3 <= self.voxel_size <= self.max_range:
            span = f"from 0.001 m to max_range ({self.max_range:g} m)"
            raise InputError(f"metric_map.voxel_size = {self.voxel_size:g}: must be {span}")
        if not 0 <= self.margin < np.inf:
            raise InputError(f"metric_map.margin = {self.margin}: must be non-negative and finite")
        if np.shape(self.offset) != (3,) or not np.isfinite(self.offset).all():
            raise InputError(f"metric_map.offset = {self.offset}: must be three finite numbers")
        if not 0 < self.miss < self.hit <= self.max_log_odds <= np.iinfo(np.int8).max:
            values = f"miss = {self.miss}, hit = {self.hit}, max_log_odds = {self.max_log_odds}"
            raise InputError(f"metric_map: {values}: must satisfy 0 < miss < hit <= max_log_odds <= 127")
        if not isinstance(self.max_bytes, int) or self.max_bytes <= 0:
            raise InputError(f"metric_map.max_bytes = {self.max_bytes}: must be a positive whole number")

    @property
    def min_log_odds(self) -> int:
        """Minimum value of a voxel; a single hit outweighs it."""
        return self.miss - self.hit
