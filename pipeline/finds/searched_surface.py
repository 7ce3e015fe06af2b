"""Which surface was searched for people and finds, and from how near."""

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Pose
from pipeline.finds.config import SearchConfig
from pipeline.frame import Frame

Voxel = tuple[int, int, int]


class Sight(NamedTuple):
    """What a frame shows of the surface.

    Attributes:
        nearest: m, the least distance of the returns in each voxel of ``map``.
        returns: number of returns in each.
        pixels: number of pixels, with a return or without.
    """

    nearest: dict[Voxel, float]
    returns: dict[Voxel, int]
    pixels: int


class SearchedSurface:
    """Voxels of surface, each with the least distance from which it was searched."""

    def __init__(self, config: SearchConfig = SearchConfig()) -> None:
        """Nothing was searched yet."""
        self._config = config
        self._nearest: dict[Voxel, float] = {}

    def sight(self, frame: Frame, T_map_camera: Pose) -> Sight:
        """What a frame shows; what is nearer than anything must be to be recognised counts as that near."""
        depth, lens = frame.every_nth(self._config.stride)
        points = lens.points(np.where(np.isfinite(depth), depth, 0), T_map_camera)
        ways = np.maximum(np.linalg.norm(points - T_map_camera[:3, 3], axis=1), self._config.near).tolist()
        sight = Sight({}, {}, depth.size)
        for (i, j, k), way in zip(np.floor(points / self._config.voxel).astype(np.int64).tolist(), ways, strict=True):
            sight.nearest[i, j, k] = min(way, sight.nearest.get((i, j, k), np.inf))
            sight.returns[i, j, k] = sight.returns.get((i, j, k), 0) + 1
        return sight

    def is_new(self, sight: Sight) -> bool:
        """Whether enough of the image shows surface that was not searched from about as near."""
        nearer, before = self._config.nearer, self._nearest
        new = [voxel for voxel, way in sight.nearest.items() if way < nearer * before.get(voxel, np.inf)]
        return sum(sight.returns[voxel] for voxel in new) >= self._config.share * sight.pixels

    def add(self, sight: Sight) -> None:
        """What a frame shows was searched."""
        for voxel, way in sight.nearest.items():
            self._nearest[voxel] = min(way, self._nearest.get(voxel, np.inf))
