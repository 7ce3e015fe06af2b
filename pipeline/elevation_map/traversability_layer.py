"""The traversability of an elevation map, updated incrementally."""

from dataclasses import replace

import numpy as np

from pipeline.arrays import MaskLayer
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import LAYERS, Traversability, assess, assess_map, reach_of
from pipeline.grid_map import box_around, inside


class TraversabilityLayer:
    """Assesses one elevation map repeatedly, each time only around the cells that changed."""

    def __init__(self) -> None:
        self._last: Traversability | None = None
        self._revision = 0

    def update(self, elevation_map: ElevationMap) -> Traversability:
        """Return the same as ``assess_map`` of the map; results returned before do not change."""
        source, last = elevation_map.layers, self._last
        changed = source.changed_since(self._revision, "elevation", "dropout", "driven")
        self._revision = source.revision
        if last is None or not last.grid.is_same(source.grid):
            # A hazard at the old border affects the cells that the grid has gained.
            last = assess_map(elevation_map)
        elif changed.any():
            last = _assessed_around(changed, elevation_map, last)
        self._last = last
        return last


def _assessed_around(changed: MaskLayer, elevation_map: ElevationMap, last: Traversability) -> Traversability:
    # A cell affects hazards across a gap and the slopes around it, and a hazard affects the cells within its reach.
    cell, config = last.grid.cell, last.config
    reach = round((reach_of(last.robot, config, cell) + config.drop_gap) / cell) + 2 * config.slope_reach + 1
    here, around = box_around(changed, reach), box_around(changed, 2 * reach)
    # The kernels are compiled for contiguous arrays.
    elevation = np.ascontiguousarray(elevation_map.elevation[around])
    dropout, driven = elevation_map.dropout[around], elevation_map.driven[around]
    within = inside(here, around)
    part = assess(last.grid.part(around), elevation, dropout, driven, last.robot, config, within)
    layers = {name: getattr(last, name).copy() for name in LAYERS}
    for name, layer in layers.items():
        layer[here] = getattr(part, name)[within]
    return replace(last, **layers)
