"""The drivable surface of a map that grows look by look."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import Grid, box_around, inside
from pipeline.traversability.elevation_map import ElevationMap
from pipeline.traversability.traversability import (
    FAR,
    Traversability,
    TraversabilityConfig,
    assess,
    assess_map,
)

JUDGED = ("gradient", "hazard", "to_hazard", "traversable", "turnable", "slidable", "room", "ramp", "uphill")
"""The layers of a drivable surface that follow from its elevation, from doubt and from where the robot drove."""


class TraversabilityLayer:
    """Judges anew only around what a look has changed."""

    def __init__(self, config: TraversabilityConfig | None = None):
        self.config = config or TraversabilityConfig()
        self._last: Traversability | None = None
        self._doubted, self._driven = np.zeros((2, 0, 0), np.bool_)

    def update(self, elevation_map: ElevationMap) -> Traversability:
        """The same as :func:`assess_map` of the map; what was given out before stays as it was."""
        last, dropout, driven = self._last, elevation_map.dropout, elevation_map.driven
        if last is None or not _same(last.grid, elevation_map.grid):
            renewed = assess_map(elevation_map, self.config)
        else:
            changed = _differ(last.elevation, elevation_map.elevation) | (self._doubted != dropout)
            # To have driven there changes nothing where the robot may drive anyway.
            changed |= (self._driven != driven) & ~last.traversable
            renewed = self._renewed(last, elevation_map, dropout, changed) if changed.any() else last
        self._last, self._doubted, self._driven = renewed, dropout, driven
        return renewed

    def _renewed(
        self,
        last: Traversability,
        elevation_map: ElevationMap,
        dropout: NDArray[np.bool_],
        changed: NDArray[np.bool_],
    ) -> Traversability:
        grid = last.grid
        # A cell decides about hazards across a gap, and a hazard about what lies FAR from it; slopes span four cells.
        reach = round((FAR + self.config.max_drop_gap) / grid.cell) + 5
        here, around = box_around(changed, reach), box_around(changed, 2 * reach)
        corner = grid.origin + grid.cell * np.array([around[0].start, around[1].start])
        # Whole in memory, as the kernels are compiled for.
        heights = np.ascontiguousarray(elevation_map.elevation[around])
        part = assess(
            Grid(corner, grid.cell, heights.shape),
            heights,
            dropout[around],
            elevation_map.driven[around],
            self.config,
        )
        layers = {name: getattr(last, name).copy() for name in JUDGED}
        for name, layer in layers.items():
            layer[here] = getattr(part, name)[inside(here, around)]
        return replace(last, elevation=elevation_map.elevation, **layers)


def _same(a: Grid, b: Grid) -> bool:
    return a.shape == b.shape and bool(np.all(a.origin == b.origin))


def _differ(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(nx, ny) cells of other height, or known in one alone."""
    return np.asarray((a != b) & ~(np.isnan(a) & np.isnan(b)))
