"""The drivable surface of a map that grows look by look."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import Grid, box_around, inside
from pipeline.traversability.elevation_map import SurfaceMap
from pipeline.traversability.traversability import (
    FAR,
    DrivableConfig,
    DrivableSurface,
    drivable_surface,
    judge,
)

JUDGED = ("gradient", "hazard", "to_hazard", "drivable", "turnable", "slidable", "room", "ramp", "uphill")
"""The layers of a drivable surface that follow from its elevation, from doubt and from where the robot drove."""


class DrivableLayer:
    """Judges anew only around what a look has changed."""

    def __init__(self, config: DrivableConfig | None = None):
        self.config = config or DrivableConfig()
        self._last: DrivableSurface | None = None
        self._doubted, self._driven = np.zeros((2, 0, 0), np.bool_)

    def update(self, surface: SurfaceMap) -> DrivableSurface:
        """The same as :func:`drivable_surface` of the map; what was given out before stays as it was."""
        last, doubted, driven = self._last, surface.doubted, surface.driven
        if last is None or not _same(last.grid, surface.grid):
            renewed = drivable_surface(surface, self.config)
        else:
            changed = _differ(last.elevation, surface.elevation) | (self._doubted != doubted)
            # To have driven there changes nothing where the robot may drive anyway.
            changed |= (self._driven != driven) & ~last.drivable
            renewed = self._renewed(last, surface, doubted, changed) if changed.any() else last
        self._last, self._doubted, self._driven = renewed, doubted, driven
        return renewed

    def _renewed(
        self,
        last: DrivableSurface,
        surface: SurfaceMap,
        doubted: NDArray[np.bool_],
        changed: NDArray[np.bool_],
    ) -> DrivableSurface:
        grid = last.grid
        # A cell decides about hazards across a gap, and a hazard about what lies FAR from it; slopes span four cells.
        reach = round((FAR + self.config.max_drop_gap) / grid.cell) + 5
        here, around = box_around(changed, reach), box_around(changed, 2 * reach)
        corner = grid.origin + grid.cell * np.array([around[0].start, around[1].start])
        # Whole in memory, as the kernels are compiled for.
        heights = np.ascontiguousarray(surface.elevation[around])
        part = judge(
            Grid(corner, grid.cell, heights.shape),
            heights,
            doubted[around],
            surface.driven[around],
            self.config,
        )
        layers = {name: getattr(last, name).copy() for name in JUDGED}
        for name, layer in layers.items():
            layer[here] = getattr(part, name)[inside(here, around)]
        return replace(last, elevation=surface.elevation, **layers)


def _same(a: Grid, b: Grid) -> bool:
    return a.shape == b.shape and bool(np.all(a.origin == b.origin))


def _differ(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(nx, ny) cells of other height, or known in one alone."""
    return np.asarray((a != b) & ~(np.isnan(a) & np.isnan(b)))
