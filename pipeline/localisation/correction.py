"""How places in ``map`` that belong to no keyframe follow a correction of the keyframes' poses."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation


class Correction:
    """Moves places along with the keyframe that stood nearest to them.

    Attributes:
        motions: (N, 4, 4) of each keyframe, from ``map`` before the correction to ``map`` after it.
        ways: (N,) m by which each keyframe moved.
        turns: (N,) rad by which each turned.
    """

    def __init__(self, before: NDArray[np.float64], after: NDArray[np.float64]) -> None:
        """``before``, ``after``: (N, 4, 4) poses of the keyframes, N at least 1."""
        self.motions = after @ np.linalg.inv(before)
        self.ways = np.linalg.norm((after - before)[:, :3, 3], axis=1)
        self.turns = Rotation.from_matrix(self.motions[:, :3, :3]).magnitude()
        self._tree = cKDTree(before[:, :2, 3])

    def motion_at(self, places: NDArray[np.floating]) -> NDArray[np.float64]:
        """(..., 4, 4) motions of the keyframes that stood nearest to places (..., 2 or 3), m."""
        return np.asarray(self.motions[self._tree.query(places[..., :2])[1]])

    def moved(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2 or 3) float64 places, m, each moved along with the keyframe that stood nearest to it."""
        return moved_by(self.motion_at(places), places)


def moved_by(T: NDArray[np.float64], places: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 2 or 3) float64 places, m, moved by a 4×4 transform or by (N, 4, 4); places without z lie at z = 0."""
    size = places.shape[1]
    T = np.broadcast_to(T, (len(places), 4, 4))
    return np.asarray(np.einsum("nij,nj->ni", T[:, :size, :size], places) + T[:, :size, 3])
