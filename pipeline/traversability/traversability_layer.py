"""The traversability of an elevation map, updated from keyframe to keyframe."""

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import GridMap, Layer, box_around, inside
from pipeline.traversability.elevation_map import CELL, ElevationMap
from pipeline.traversability.pose_kernels import HEADINGS
from pipeline.traversability.traversability import FAR, MAX_DROP_GAP, Traversability, assess

_NO = Layer(np.bool_)
JUDGED = {
    "gradient": Layer(np.float32, per_cell=(2,)),
    "hazard": _NO,
    "to_hazard": Layer(np.float64),
    "obstacle": Layer(np.uint8),
    "to_obstacle": Layer(np.float64),
    "clearance": Layer(np.int8, per_cell=(HEADINGS,)),
    "least": Layer(np.int8),
    "ramp": _NO,
    "uphill": Layer(np.float32, per_cell=(2,)),
    "free": Layer(np.uint8, per_cell=(2,)),
    "turnable": _NO,
    "tall": _NO,
    "sealed": Layer(np.float32),
}
"""The layers computed from the elevation, from depth dropouts and from where the robot drove."""

REACH = round((FAR + MAX_DROP_GAP) / CELL) + 5
"""Cells within which a change has an effect: a cell affects hazards across a gap, a hazard affects cells up to
``FAR`` from it, and slopes span four cells."""


class TraversabilityLayer:
    """Assesses one elevation map again, but only around cells that changed."""

    def __init__(self) -> None:
        self._layers = GridMap(CELL, JUDGED)
        self._last: Traversability | None = None
        self._revision = 0

    def update(self, elevation_map: ElevationMap) -> Traversability:
        """Return the same as ``assess_map`` of the map; results that were returned before stay as they were."""
        source, layers = elevation_map.layers, self._layers
        changed = source.changed_since(self._revision, "elevation", "dropout", "driven")
        # A hazard at the old border reaches into the cells that the grid has gained.
        changed |= not layers.grid.is_same(source.grid)
        layers.match(source.grid)
        revision, self._revision = layers.revision, source.revision
        if changed.any():
            self._assess_around(changed, elevation_map)
        if self._last is not None and layers.revision == revision and self._last.grid is source.grid:
            return self._last
        judged = {name: layers[name] for name in JUDGED}
        self._last = Traversability(source.grid, elevation_map.elevation, robot=elevation_map.robot, **judged)
        return self._last

    def _assess_around(self, changed: NDArray[np.bool_], elevation_map: ElevationMap) -> None:
        here, around = box_around(changed, REACH), box_around(changed, 2 * REACH)
        # Contiguous, as the kernels are compiled for.
        elevation = np.ascontiguousarray(elevation_map.elevation[around])
        dropout, driven = elevation_map.dropout[around], elevation_map.driven[around]
        within = inside(here, around)
        part = assess(self._layers.grid.part(around), elevation, dropout, driven, elevation_map.robot, within)
        for name in JUDGED:
            self._layers.write(name, getattr(part, name)[within], here)
