"""Accuracy of the mapped points, relative to the true surfaces that the camera had in view."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.geometry.thinning import VoxelCloud

F1_WITHIN = {"f1_5cm": 0.05, "f1_10cm": 0.1}
"""Distances within which a point counts as right, m."""


class SurfaceScore:
    """Collects noise-free points, in the world, thinned to voxels as in the semantic map."""

    def __init__(self, voxel: float) -> None:
        """Start without points; ``voxel``: edge of the map's voxels, m."""
        self._voxel = voxel
        self._surface, self._new = np.zeros((0, 3), np.float32), list[NDArray[np.float32]]()

    def add(self, points: NDArray[np.float32]) -> None:
        """Add the noise-free points (N, 3) of a frame, m in the world."""
        self._new.append(VoxelCloud.of(points, self._voxel).points)
        if sum(map(len, self._new)) > len(self._surface):  # so that each point is thinned again only a few times
            self._merge()

    def _merge(self) -> None:
        self._surface = VoxelCloud.of(np.concatenate([self._surface, *self._new]), self._voxel).points
        self._new.clear()

    def report(self, points: NDArray[np.float32]) -> dict[str, float]:
        """The figures of a map with points (M, 3), m; empty if nothing was seen."""
        self._merge()
        return f1_scores(points, self._surface) if len(self._surface) else {}


def f1_scores(points: NDArray[np.float32], surface: NDArray[np.float32]) -> dict[str, float]:
    """The F1 score for each distance in :data:`F1_WITHIN`, m: the harmonic mean of precision and recall.

    Precision is the share of the points (M, 3) within that distance of the surface (N, 3); recall, the share of the
    surface's points within that distance of the points (Knapitsch et al., "Tanks and Temples", 2017).
    """
    if not len(points):
        return dict.fromkeys(F1_WITHIN, 0.0)
    farthest = max(F1_WITHIN.values())
    apart = [cKDTree(b).query(a, distance_upper_bound=farthest)[0] for a, b in ((points, surface), (surface, points))]
    shares = {name: [float(np.mean(d <= within)) for d in apart] for name, within in F1_WITHIN.items()}
    return {name: 2 * p * r / (p + r) if p + r else 0.0 for name, (p, r) in shares.items()}
