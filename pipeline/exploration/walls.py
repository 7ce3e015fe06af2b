"""Pieces of walls that keyframes show, and how many pixels wide a sign on them would be."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Directions, Indices, Mask, Places, Values
from pipeline.exploration.config import InspectionConfig
from pipeline.frame import Frame
from pipeline.keyframes import UNIT, Seen
from pipeline.transforms import transform_places


class WallPieces(NamedTuple):
    """Pieces of walls.

    Attributes:
        points: centres of the pieces.
        normals: normals that point away from the wall.
        sides: foreshortened width of a typical sign on each piece, as the keyframe would show it, pixels.
        config: settings of the inspection.
    """

    points: Places
    normals: Directions
    sides: Values
    config: InspectionConfig

    @classmethod
    def of(cls, seen: Seen, frame: Frame, config: InspectionConfig) -> "WallPieces":
        """The pieces that a keyframe shows, in its ``base_link``: image squares that are flat, upright and low.

        ``frame``: any frame of the same camera.
        """
        squares = _squares(seen.intrinsics.rays * (seen.depth * UNIT)[..., None], config.square)
        middle = squares.mean(axis=1)
        apart = squares - middle[:, None]
        variances, axes = np.linalg.eigh(apart.swapaxes(1, 2) @ apart / apart.shape[1])
        normals = axes[..., 0] * -np.sign((axes[..., 0] * middle).sum(axis=1))[:, None]
        T = seen.T_base_camera
        found = cls(transform_places(T, middle), normals @ T[:3, :3].T, np.zeros(len(middle)), config)
        is_flat = variances[:, 0] < (config.flatness * frame.sensor.sigma(middle[:, 2])) ** 2
        is_upright, height = np.abs(found.normals[:, 2]) < config.upright, found.points[:, 2]
        found = found.where(is_flat & is_upright & (height > 0) & (height < config.highest))
        return found._replace(sides=found.sides_from(T[None, :3, 3], frame)[:, 0])

    def where(self, index: Mask | Indices) -> "WallPieces":
        """The pieces that an index selects."""
        return WallPieces(self.points[index], self.normals[index], self.sides[index], self.config)

    def sides_from(self, cameras: ArrayLike, frame: Frame) -> NDArray[np.float64]:
        """(N, M) pixels across a typical sign on each piece, foreshortened, for cameras (M, 3), m; 0 from behind."""
        ways = np.asarray(cameras, np.float64) - self.points[:, None]
        distances = np.maximum(np.linalg.norm(ways, axis=2), frame.sensor.nearest / 2)
        cosines = np.einsum("nmi,ni->nm", ways, self.normals) / distances
        return frame.intrinsics.fx * self.config.sign * np.maximum(cosines, 0) / distances

    @property
    def before(self) -> Places:
        """The point in front of each piece that represents it."""
        return self.points + self.config.before * self.normals


def _squares(points: NDArray[np.float32], side: int) -> NDArray[np.float64]:
    """(N, S², 3) the squares of S × S points of an image (H, W, 3), m, without squares that lack a return."""
    h, w = points.shape[0] // side, points.shape[1] // side
    parts = points[: h * side, : w * side].reshape(h, side, w, side, 3).swapaxes(1, 2).reshape(h * w, side**2, 3)
    return parts[(parts[..., 2] > 0).all(axis=1)].astype(np.float64)
