"""How much unseen ground every ray of every view should show, kept from look to look."""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.exploration import visibility_kernels as kernels


class ViewAreas:
    """Casts rays only from where something within their reach has changed since they were cast last."""

    def __init__(self, rays: int, stride: int, sight: kernels.Sight):
        """Views lie on every ``stride``-th cell and have so many ``rays`` around the circle."""
        self._rays, self._stride, self._sight = rays, stride, sight
        self._ground: kernels.Ground | None = None
        self._row = np.zeros((0, 0), np.int64)
        self._areas = np.zeros((0, rays))

    def of(self, cells: NDArray[np.int64], ground: kernels.Ground) -> NDArray[np.float64]:
        """(N, rays) m² that each ray should show from the cells (N, 2), which are multiples of the stride."""
        self._forget_changed(ground)
        i, j = (cells // self._stride).T
        row = self._row[i, j]
        areas = np.zeros((len(cells), self._rays))
        areas[row >= 0] = self._areas[row[row >= 0]]
        places = ground.origin + (cells[row < 0] + 0.5) * ground.cell
        areas[row < 0] = kernels.ray_areas(places, self._rays, self._sight, ground)
        self._row[:], self._row[i, j] = -1, np.arange(len(cells))
        self._areas = areas
        return areas

    def _forget_changed(self, ground: kernels.Ground) -> None:
        """Forget what was seen from places in reach of cells that have changed."""
        blocks = tuple(-(-n // self._stride) for n in ground.target.shape)
        last, self._ground = self._ground, ground
        if last is None or last.target.shape != ground.target.shape or np.any(last.origin != ground.origin):
            self._row = np.full(blocks, -1)
            return
        nx, ny = ground.target.shape
        changed = np.zeros(np.multiply(blocks, self._stride), np.bool_)
        changed[:nx, :ny] = _changed(last, ground)
        untouched = ~changed.reshape(blocks[0], self._stride, blocks[1], self._stride).any(axis=(1, 3))
        if not untouched.all():
            # Two blocks more: a view and a change may lie anywhere in theirs.
            reach = self._sight.reach / (self._stride * ground.cell) + 2
            self._row[ndimage.distance_transform_edt(untouched) <= reach] = -1


def _changed(a: kernels.Ground, b: kernels.Ground) -> NDArray[np.bool_]:
    """(nx, ny) the cells of one grid that differ."""
    both_unknown = np.isnan(a.elevation) & np.isnan(b.elevation)
    changed = (a.elevation != b.elevation) & ~both_unknown
    changed |= (a.target != b.target) | (a.hope != b.hope)
    return changed | (a.gradient != b.gradient).any(axis=-1) | (a.missed_from != b.missed_from).any(axis=-1)
