"""The patches of which segments are made, kept so that segments follow when poses are corrected."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.segments.cells import CELL, SHIFT, Cells, from_keys
from pipeline.segments.cells_kernels import cells_of, cells_of_parts
from pipeline.segments.plane import Moments
from pipeline.segments.planes import PlanePatch


@dataclass(frozen=True, eq=False)
class Member:
    """The kept data of a patch, in ``map`` as it was when the patch was seen.

    Attributes:
        step: the step in which it was seen.
        normal: (3,) of its plane.
        moments: of its surfels.
        outline: (V, 3) float32 corners of the convex hull of its points, m.
        points: (N, 3) float32, m, one of its points in each cube with half the edge of a cell.
    """

    step: int
    normal: NDArray[np.float64]
    moments: Moments
    outline: NDArray[np.float32]
    points: NDArray[np.float32]

    @classmethod
    def of(cls, patch: PlanePatch, step: int) -> Self:
        """The member of a patch that was seen in a step."""
        across = np.eye(3)[np.abs(patch.plane.normal).argmin()]
        u = np.cross(patch.plane.normal, across)
        v = np.cross(patch.plane.normal, u)
        flat = np.ascontiguousarray(patch.points @ np.stack([u, v], axis=1), np.float32)
        corners = cv2.convexHull(flat, returnPoints=False)[:, 0]
        found, keys = cells_of(patch.points + np.float32(SHIFT), np.float32(2 / CELL))
        first = np.empty(len(keys), np.intp)
        first[found[::-1]] = np.arange(len(found))[::-1]
        return cls(step, patch.plane.normal, patch.moments, patch.points[corners], patch.points[first])


class MovedMembers:
    """All members, moved along with the poses from which they were seen.

    Attributes:
        normals: (P, 3).
        counts: (P,) number of surfels of each.
        centres: (P, 3) mean of these surfels, m.
    """

    def __init__(self, members: Sequence[Member], motions: NDArray[np.float64]) -> None:
        """``motions``: (N, 4, 4) of every step, from ``map`` as it was when its patches were seen to ``map``."""
        self._T = motions[[m.step for m in members]]
        R, t = self._T[:, :3, :3], self._T[:, :3, 3]
        self.counts = np.array([m.moments.count for m in members])
        total = np.einsum("pij,pj->pi", R, np.array([m.moments.total for m in members]))
        squares = R @ np.array([m.moments.squares for m in members]) @ R.swapaxes(1, 2)
        cross = total[:, :, None] * t[:, None]
        n = self.counts[:, None]
        self._totals = total + n * t
        self._squares = squares + cross + cross.swapaxes(1, 2) + n[..., None] * t[:, :, None] * t[:, None]
        self.normals = np.einsum("pij,pj->pi", R, np.array([m.normal for m in members]))
        self.centres = self._totals / n
        self._outline_starts = np.cumsum([0, *(len(m.outline) for m in members)])
        of_corner = np.repeat(np.arange(len(members)), np.diff(self._outline_starts))
        outlines = np.concatenate([m.outline for m in members]).astype(np.float64)
        self._point_starts = np.cumsum([0, *(len(m.points) for m in members)])
        self._points = np.concatenate([m.points for m in members])
        self._outlines = np.einsum("pij,pj->pi", R[of_corner], outlines) + t[of_corner]

    def moments(self, rows: NDArray[np.intp]) -> Moments:
        """The sum of the moments of the members with these indices (K,)."""
        return Moments(int(self.counts[rows].sum()), self._totals[rows].sum(axis=0), self._squares[rows].sum(axis=0))

    def outline(self, row: int) -> NDArray[np.float64]:
        """(V, 3) corners of a member's convex hull, m."""
        return self._outlines[self._outline_starts[row] : self._outline_starts[row + 1]]

    def cells(self, rows: NDArray[np.intp]) -> Cells:
        """(K, 3) cells that contain the points of some members."""
        shift, per_metre = np.float32(SHIFT), np.float32(1 / CELL)
        return from_keys(cells_of_parts(rows, self._point_starts, self._T, self._points, shift, per_metre))

    def misfits(self, rows: NDArray[np.intp], reference: int) -> NDArray[np.float64]:
        """(K,) m, the distance of each member's farthest corner from the plane of the member ``reference``."""
        offsets = [np.abs((self.outline(r) - self.centres[reference]) @ self.normals[reference]).max() for r in rows]
        return np.array(offsets)
