"""The elevation map: the height of the ground in each cell.

Voxels of 0.1 m cannot distinguish a ramp from a step, so the elevation map keeps the mean heights of the returns in
finer columns.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Boxes, Cells, Mask, MaskLayer, Place, Points
from pipeline.elevation_map import elevation_kernels as kernels
from pipeline.elevation_map import pose_kernels
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.overhangs_kernels import OPEN, ROOFED
from pipeline.grid_map import (
    CellWindow,
    Grid,
    GridMap,
    LayerType,
    box_around,
    check_memory,
    ensure_capacity,
    relative_to,
)
from pipeline.robot import RobotModel
from pipeline.sensor import XTION

STRAY_FRACTION = 0.1
"""Fraction of a bin's returns that may stray into an adjacent bin."""
RAY_HEIGHT = 0.3
"""Maximum height above a cell's ground at which a passing ray shows that the cell contains no wall, m."""
NO_POINTS = np.zeros((0, 3), np.float32)
_UNKNOWN = LayerType(np.float32, np.nan)
_DERIVED = {
    "measured": _UNKNOWN,
    "elevation": _UNKNOWN,
    "dropout": LayerType(np.bool_),
    "driven": LayerType(np.uint16),
}
_SCRATCH = {
    "returned": LayerType(np.float32, np.nan, in_place=True),
    # Numbers of returns and dropouts of the keyframe that is being added; 0 otherwise.
    "returns": LayerType(np.int32, in_place=True),
    "dropouts": LayerType(np.int32, in_place=True),
}


_EVIDENCE = {
    "ceiling": LayerType(np.float32, np.inf, in_place=True),
    "roofed": LayerType(np.float32, np.inf, in_place=True),
    "open": LayerType(np.float32, np.inf, in_place=True),
    "assumed": LayerType(np.float32, np.nan, in_place=True),
    "touched": LayerType(np.float32, np.nan, in_place=True),
    "dropout_direction": LayerType(np.float32, per_cell=(2,), in_place=True),
    "dropout_extent": LayerType(np.float32, in_place=True),
    "been": LayerType(np.uint16, in_place=True),
    "swept": LayerType(np.bool_, in_place=True),
}
"""The layers that keyframes change, in addition to the bins of columns."""
_ROWS = {"row": LayerType(np.int32, kernels.NO_COLUMN, in_place=True)}


class ElevationMap:
    """A grid map of the ground that grows where points are added.

    Attributes:
        robot: the robot, whose ``max_gap`` is the widest gap that is filled, and whose ``headroom`` is the free
            height above the ground.
        config: settings of the map.
        layers: all layers; changes of ``measured``, ``elevation``, ``dropout`` and ``driven`` are tracked.
    """

    def __init__(self, robot: RobotModel, config: ElevationConfig = ElevationConfig()):
        self.robot, self.config = robot, config
        self._columns = kernels.Columns(config.bin, robot.headroom, config.min_returns, STRAY_FRACTION)
        self.layers = GridMap(config.cell, _DERIVED | _EVIDENCE | _ROWS | _SCRATCH)
        self._lowest = np.zeros(0)
        self._height, self._hits = (np.zeros((0, config.levels), dtype) for dtype in (np.float32, np.uint16))
        self._column_count = 0
        self._rebuilding: MaskLayer | None = None
        self._everywhere = np.zeros((0, 0), np.bool_)

    @property
    def grid(self) -> Grid:
        """The current grid."""
        return self.layers.grid

    @property
    def measured(self) -> NDArray[np.float32]:
        """(nx, ny) m, height of the ground or of obstacles that were seen or touched; NaN elsewhere."""
        return self.layers["measured"]

    @property
    def elevation(self) -> NDArray[np.float32]:
        """(nx, ny) m, ``measured`` with small gaps filled and the ground assumed at the start; NaN where unknown."""
        return self.layers["elevation"]

    @property
    def dropout(self) -> MaskLayer:
        """The cells where a thin panel without returns may stand; their ground is unknown whatever was seen there."""
        return self.layers["dropout"]

    @property
    def swept(self) -> MaskLayer:
        """The cells over which the robot's body has been."""
        return self.layers["swept"]

    @property
    def driven(self) -> NDArray[np.uint16]:
        """(nx, ny) bits of the headings that the robot has had with its centre in each cell, and of its turns there.

        Bit h belongs to entry h of :attr:`pose_kernels.Terrain.clearance`. Obstacles found later clear bits.
        """
        return self.layers["driven"]

    def assume_ground(self, points: NDArray[np.floating]) -> None:
        """Assume ground at the heights of points (N, 3), m, in their cells until it is measured."""
        self._set_heights("assumed", points)

    def add_obstacle(self, points: NDArray[np.floating]) -> None:
        """Add an obstacle that the robot touched to the cells of points (N, 3), m; no keyframe removes it."""
        self._set_heights("touched", points)

    def _set_heights(self, layer: str, points: NDArray[np.floating]) -> None:
        """Write the heights of points (N, 3), m, to their cells of a layer."""
        if not len(points):
            return
        self.cover(points)
        cells = self.grid.cell_of(points)
        inside = self._within[tuple(cells.T)]
        where = tuple(cells[inside].T)
        self.layers[layer][where] = points[inside, 2]
        self._update_derived(where)

    def forget_track(self, points: NDArray[np.floating]) -> None:
        """Forget the driven poses at which obstacles at points (N, 3), m, would be inside the footprint."""
        if not len(points):
            return
        self.cover(points)
        offsets, distances, _ = pose_kernels.footprint_distances(
            self.robot.half_length,
            self.robot.half_width,
            self.grid.cell,
            self.config.traversability.costs.full_speed_clearance,
        )
        cells = np.unique(self.grid.cell_of(points), axis=0)
        kernels.clear_poses(cells, offsets, distances, self._within, self.layers["been"])
        reached = cells[:, None] - offsets
        self._update_derived(tuple(reached[self.grid.holds(reached)].T))

    def add_track(self, track: NDArray[np.float64]) -> None:
        """Mark successive poses (N, 3) of the robot's centre, m and rad; the cells that it swept contain no panel."""
        if not len(track):
            return
        places = track[:, :2]
        self.cover(np.vstack([places - self.robot.half_width, places + self.robot.half_width]))
        cells = self.grid.cell_of(places)
        poses = pose_kernels.heading_bits(cells, track[:, 2])
        kernels.mark_swept(cells, poses, self._disc, self._within, self.layers["been"], self.layers["swept"])
        if self._rebuilding is None:
            self._update_derived(tuple((cells[:, None] + self._disc).reshape(-1, 2).T))

    @cached_property
    def _disc(self) -> Cells:
        """(D, 2) cells that a robot in cell (0, 0) certainly sweeps, even if its position is wrong by a cell."""
        cell = self.grid.cell
        reach = max(self.robot.half_width - cell, 0.0)
        square = np.argwhere(np.ones((2 * int(reach / cell) + 1,) * 2)) - int(reach / cell)
        return square[np.hypot(*square.T) * cell <= reach]

    def update(
        self,
        points: Points,
        hits: NDArray[np.uint8] | None = None,
        dropouts: Points = NO_POINTS,
        dropout_hits: NDArray[np.uint8] | None = None,
        rays: Points = NO_POINTS,
        camera: Place | None = None,
        above: NDArray[np.uint8] | None = None,
        height: float = 0.0,
    ) -> None:
        """Add the evidence of a keyframe.

        Args:
            points: (N, 3) the keyframe's returns in ``map``, m; without any, all other evidence is ignored, too.
            hits: (N,) number of returns averaged in each point; 1 if not given.
            dropouts: (M, 3) points where ground should have been seen but was not.
            dropout_hits: (M,) number of pixels averaged in each dropout; 1 if not given.
            rays: points on rays that passed over ground without returns, see :func:`elevation_kernels.lowest_rays`.
            camera: position of the camera; without it, dropouts are neither marked nor cleared.
            above: (N,) state of the space above each point, see :func:`find_overhangs`.
            height: height of the robot in ``map``, m, to which the range of heights mapped in new cells is relative.
        """
        if not len(points):
            return
        self.cover(points)
        layers, cell, within = self.layers, (self.grid.origin, self.grid.cell), self._within
        returns, missing = layers["returns"], layers["dropouts"]
        self._reserve(len(points))
        judged = within, self._columns, self._bins
        lowest = self.config.bin * round(height / self.config.bin) + self.config.lowest
        seen = points, _counts(points, hits)
        shown, self._column_count = kernels.add_to_bins(*seen, *cell, *judged, self._column_count, lowest, returns)
        if above is not None:
            kernels.lower_to_lowest(points, above == ROOFED, *cell, within, layers["roofed"])
            kernels.lower_to_lowest(points, above == OPEN, *cell, within, layers["open"])
        passed = kernels.lower_ceiling(layers["ceiling"], rays, *cell, within)
        dropped = kernels.count_dropouts(dropouts, _counts(dropouts, dropout_hits), *cell, *judged, missing)
        cells = np.concatenate([shown, dropped])
        if camera is not None:
            marks = layers["dropout_direction"], layers["dropout_extent"]
            seen_from = camera, float(height), XTION.min_grazing_angle
            kernels.update_dropouts(*marks, missing, returns, cells, *seen_from, *cell, *judged[1:])
        missing[tuple(dropped.T)], returns[tuple(shown.T)] = 0, 0
        self._update_derived(tuple(np.concatenate([cells, passed]).T))

    @contextmanager
    def rebuilding(self, boxes: Boxes) -> Iterator[Callable[[Boxes], Mask]]:
        """Forget everything within boxes in ``map``; the body of the ``with`` statement must add the evidence again.

        Only cells within the boxes change, at any height.

        Yields:
            A function that returns whether each of some other boxes overlaps these cells.
        """
        self.cover(boxes.reshape(-1, boxes.shape[-1]))
        within, meets = self.grid.touched_by(boxes)
        for name, layer in _EVIDENCE.items():
            self.layers[name][within] = layer.fill
        rows = self.layers["row"][within]
        rows = rows[rows != kernels.NO_COLUMN]
        self._lowest[rows], self._height[rows], self._hits[rows] = np.nan, 0, 0
        self._rebuilding = within
        try:
            yield meets
        finally:
            self._rebuilding = None
        self._update_derived(np.nonzero(within))

    def cover(self, points: NDArray[np.floating]) -> None:
        """Grow the grid to contain points (N, 2 or 3), m; InputError if it would take too much memory."""
        if self._rebuilding is None:
            self.layers.cover(points)

    def _reserve(self, more: int) -> None:
        """Make room for ``more`` columns; InputError if they would take too much memory."""
        per_bin = self._height.itemsize + self._hits.itemsize
        count = self._column_count + more
        check_memory(f"the heights of {count} cells", count * self.config.levels * per_bin)
        columns = self._lowest, self._height, self._hits
        self._lowest, self._height, self._hits = (
            ensure_capacity(values, self._column_count, more) for values in columns
        )

    @property
    def _bins(self) -> kernels.Bins:
        return kernels.Bins(self.layers["row"], self._lowest, self._height, self._hits)

    @property
    def _within(self) -> MaskLayer:
        """The cells that may change."""
        if self._rebuilding is not None:
            return self._rebuilding
        if self._everywhere.shape != self.grid.shape:
            self._everywhere = np.ones(self.grid.shape, np.bool_)
        return self._everywhere

    def _update_derived(self, where: tuple[NDArray, ...]) -> None:
        """Update the derived layers in and around cells whose evidence changed; ``where`` indexes a layer."""
        if self._rebuilding is not None or not len(where[0]):
            return
        layers, gap = self.layers, round(self.robot.max_gap / self.grid.cell) + 1
        changed = np.zeros(self.grid.shape, np.bool_)
        changed[where] = True
        kernels.update_elevation(self._bins, np.argwhere(changed), self._columns, layers["returned"])
        layers.write("driven", layers["been"][where], where)
        # No panel stands where the robot has been.
        missing = layers["dropout_direction"][where].any(axis=-1)
        layers.write("dropout", missing & ~layers["swept"][where], where)
        # A pocket is filled from cells around it, which may be filled themselves.
        here, around = box_around(changed, 2 * gap), box_around(changed, 4 * gap)
        names = ("returned", "touched", "assumed", "dropout", "ceiling")
        returned, touched, assumed, dropout, ceiling = (layers[name][around] for name in names)
        doubtful = dropout | self._is_overhung(around)
        measured = np.where(np.isnan(touched), np.where(doubtful, np.float32(np.nan), returned), touched)
        known = np.where(np.isnan(measured) & ~doubtful, assumed, measured)
        bridged = kernels.bridge_gaps(known, doubtful, ceiling, gap - 1, self.config.bin, RAY_HEIGHT)
        filled = kernels.fill_pockets(bridged, doubtful, gap - 1, self.config.bin)
        layers.write("measured", measured[relative_to(here, around)], here)
        layers.write("elevation", filled[relative_to(here, around)], here)

    def _is_overhung(self, box: CellWindow) -> MaskLayer:
        """The cells of a box where a surface hides part of the headroom, and no keyframe has seen all of it.

        Cells where the robot has been are excluded, because it had headroom there.
        """
        layers, noise = self.layers, self.config.bin
        ground, roofed, seen_open, swept = (layers[name][box] for name in ("returned", "roofed", "open", "swept"))
        return (np.abs(roofed - ground) <= noise) & ~(seen_open <= ground + noise) & ~swept


def _counts(points: Points, hits: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
    """(N,) number of pixels averaged in each of the points (N, 3)."""
    return np.ones(len(points), np.uint8) if hits is None else hits
