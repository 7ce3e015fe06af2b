"""Pieces of walls as keyframes show them, and how wide an object that hangs there would be in the image."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.frame import Frame
from pipeline.keyframes import UNIT, Seen
from pipeline.tracks.likelihood import EXTENTS, HIGHEST

BEFORE = 0.3
"""m before a wall, where the depth of what hangs on it surely ends."""


class WallPieces(NamedTuple):
    """Pieces of walls.

    Attributes:
        points: (N, 3) m.
        normals: (N, 3) unit vectors, away from the wall.
        sides: (N,) pixels across the median sign there, as narrow as the pieces were seen.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    sides: NDArray[np.float64]

    @classmethod
    def of(cls, seen: Seen, frame: Frame) -> "WallPieces":
        """What a keyframe shows, in its ``base_link``: squares of 8 × 8 depths that are flat, upright and low.

        ``frame``: of the same camera.
        """
        squares = _squares(seen.intrinsics.rays * (seen.depth * UNIT)[..., None])
        middle = squares.mean(axis=1)
        apart = squares - middle[:, None]
        variances, axes = np.linalg.eigh(apart.swapaxes(1, 2) @ apart / apart.shape[1])
        normals = axes[..., 0] * -np.sign((axes[..., 0] * middle).sum(axis=1))[:, None]
        R, t = seen.T_base_camera[:3, :3], seen.T_base_camera[:3, 3]
        found = cls(middle @ R.T + t, normals @ R.T, np.zeros(len(middle)))
        is_flat = variances[:, 0] < (2 * frame.sensor.sigma(middle[:, 2])) ** 2
        is_upright = (np.abs(found.normals[:, 2]) < 1 / 2) & (found.points[:, 2] > 0) & (found.points[:, 2] < HIGHEST)
        found = found.where(is_flat & is_upright)
        return found._replace(sides=found.sides_from(t[None], frame)[:, 0])

    def where(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> "WallPieces":
        """Those pieces."""
        return WallPieces(*(part[index] for part in self))

    def sides_from(self, cameras: ArrayLike, frame: Frame) -> NDArray[np.float64]:
        """(N, M) pixels across the median sign on each piece, as narrow as cameras (M, 3) see it; 0 from behind."""
        ways = np.asarray(cameras, np.float64) - self.points[:, None]
        distances = np.maximum(np.linalg.norm(ways, axis=2), frame.sensor.nearest / 2)
        cosines = np.einsum("nmi,ni->nm", ways, self.normals) / distances
        side, _, _ = EXTENTS["hazmat_sign"][0]
        return frame.intrinsics.fx * side * np.maximum(cosines, 0) / distances

    @property
    def before(self) -> NDArray[np.float64]:
        """(N, 3) m, the places before the pieces: those of two sides of a wall are apart."""
        return self.points + BEFORE * self.normals


def _squares(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N, 64, 3) the squares of 8 × 8 points of an image (H, W, 3), m, without those that lack any."""
    side = 2**3
    h, w = points.shape[0] // side, points.shape[1] // side
    parts = points[: h * side, : w * side].reshape(h, side, w, side, 3).swapaxes(1, 2).reshape(h * w, side**2, 3)
    return parts[(parts[..., 2] > 0).all(axis=1)].astype(np.float64)
