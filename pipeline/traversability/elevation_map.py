"""How high the ground is, cell by cell.

Voxels of 0.1 m cannot tell a ramp from a step, so the layer keeps the mean height of the returns in finer columns.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import Grid, box_around, inside
from pipeline.traversability import elevation_kernels as kernels


@dataclass(frozen=True)
class ElevationMapConfig:
    """How the surface is measured.

    Attributes:
        cell: side of a cell, m.
        z_min, z_max: heights that matter to the robot, m in ``map``.
        z_bin: returns of one column within such a slice are averaged, m. Slices are centred on z = 0.
        min_hits: returns that make a slice count.
        headroom: air that the robot needs above the ground, m.
        max_gap: unknown gaps no wider are filled, m: a Pioneer 3-AT rolls over them.
        max_gap_rise: if the ground beyond differs by no more than this, m.
        dropout_height: missing points no further above or below the ground make it doubtful, m.
        sure_angle: doubted ground is believed when it is seen from a direction that differs by this, rad: a panel
            that sends nothing back is seen within 8° of its plane.
        block: the layer grows by such strips, m.
    """

    cell: float = 0.05
    z_min: float = -0.575
    z_max: float = 2.075
    z_bin: float = 0.05
    min_hits: int = 3
    headroom: float = 0.65
    max_gap: float = 0.15
    max_gap_rise: float = 0.05
    dropout_height: float = 0.1
    sure_angle: float = np.deg2rad(15)
    block: float = 6.4


class ElevationMap:
    """A grid over ``map``'s xy plane, indexed [i, j] along x and y, that grows where points fall.

    Attributes:
        measured: (nx, ny) float32 height of the ground from returns alone, NaN where there are none.
        elevation: the same with small gaps filled and the ground assumed at the start; NaN where unknown.
        dropout: (nx, ny) bool, where something that the camera does not see may stand: unknown, whatever the returns.
        driven: (nx, ny) bool, where the middle of the robot has been.
        revision: counts the updates.
    """

    def __init__(self, config: ElevationMapConfig | None = None):
        self.config = config or ElevationMapConfig()
        self._origin = np.zeros(2)
        self.revision = 0
        self._levels = round((self.config.z_max - self.config.z_min) / self.config.z_bin)
        self._allocate(0, 0)

    def _allocate(self, nx: int, ny: int) -> None:
        self._height = np.zeros((nx, ny, self._levels), np.float32)
        self._hits = np.zeros((nx, ny, self._levels), np.uint16)
        self._assumed = np.full((nx, ny), np.nan, np.float32)
        self._dropout = np.zeros((nx, ny, 2), np.float32)
        self._felt = np.full((nx, ny), np.nan, np.float32)
        self.driven = np.zeros((nx, ny), np.bool_)
        self._shown = np.full((nx, ny), np.nan, np.float32)
        self.measured = np.full((nx, ny), np.nan, np.float32)
        self.elevation = np.full((nx, ny), np.nan, np.float32)

    @property
    def _layers(self) -> list[NDArray]:
        return [
            self._height,
            self._hits,
            self._assumed,
            self._dropout,
            self._felt,
            self.driven,
            self._shown,
            self.measured,
            self.elevation,
        ]

    @property
    def grid(self) -> Grid:
        """Where the cells lie now."""
        return Grid(self._origin, self.config.cell, self.elevation.shape)

    def assume_ground(
        self, T_map_base: NDArray[np.float64], radius: float, ahead: float, width: float
    ) -> None:
        """Take the ground under the robot and just before it for flat until it is measured.

        Args:
            T_map_base: pose of the robot.
            radius: of a disc around it, m.
            ahead: length of a strip that runs forward from its middle, m.
            width: of the strip, m.
        """
        centre, reach = T_map_base[:2, 3], max(radius, ahead)
        self._grow(np.array([centre - reach, centre + reach]))
        cells = self.grid.centre_of(np.moveaxis(np.indices(self.grid.shape), 0, -1))
        x, y = np.moveaxis((cells - centre) @ T_map_base[:2, :2], -1, 0)
        on_strip = (x >= 0) & (x <= ahead) & (np.abs(y) <= width / 2)
        promised = (np.hypot(x, y) <= radius) | on_strip
        self._assumed[promised] = T_map_base[2, 3]
        self._refresh(promised)

    def add_obstacle(self, points: NDArray[np.float64]) -> None:
        """Put an obstacle that the robot felt into the cells of (N, 3) points; it stays, whatever is seen there."""
        self._grow(points[:, :2])
        i, j = self.grid.cell_of(points).T
        self._felt[i, j] = points[:, 2]
        self._refresh(~np.isnan(self._felt))

    def add_track(self, places: NDArray[np.float64]) -> None:
        """Tell that the middle of the robot was at (N, 2) places."""
        if not len(places):
            return
        self._grow(places)
        self.driven = self.driven.copy()
        self.driven[tuple(self.grid.cell_of(places).T)] = True
        self.revision += 1

    @property
    def dropout(self) -> NDArray[np.bool_]:
        """(nx, ny) where a thin panel may stand that sent nothing back."""
        return np.asarray((self._dropout[..., 0] != 0) | (self._dropout[..., 1] != 0))

    def update(
        self,
        points: NDArray[np.float32],
        missing: NDArray[np.float32] | None = None,
        camera: NDArray[np.float64] | None = None,
    ) -> None:
        """Add the returns of a look.

        Args:
            points: (N, 3) in ``map``; those that are not finite are ignored.
            missing: (M, 3) where ground should have been seen, if anywhere.
            camera: (2 or 3,) from where, m.
        """
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return
        config = self.config
        self._grow(points[:, :2])
        touched = np.zeros(self.grid.shape, np.int32)
        kernels.accumulate(
            points, self._origin, config.cell, config.z_min, config.z_bin, self._height, self._hits, touched
        )
        kernels.extract_elevation(
            self._height, self._hits, touched, config.min_hits, config.headroom, config.z_bin, self._shown
        )
        changed = touched > 0
        if missing is not None and camera is not None:
            changed |= self._renew_dropout(missing, camera, touched)
        self._refresh(changed)

    def _renew_dropout(
        self, missing: NDArray[np.float32], camera: NDArray[np.float64], returns: NDArray[np.int32]
    ) -> NDArray[np.bool_]:
        """(nx, ny) the cells where something was missing."""
        config, count = self.config, np.zeros(self.grid.shape, np.int32)
        kernels.count_points(missing, self._origin, config.cell, self._shown, config.dropout_height, count)
        kernels.renew_dropout(
            self._dropout,
            count,
            returns,
            config.min_hits,
            camera,
            self._origin,
            config.cell,
            np.cos(config.sure_angle),
        )
        return np.asarray(count > 0)

    def _refresh(self, changed: NDArray[np.bool_]) -> None:
        """Renew what follows from cells (nx, ny) that changed; layers that were given out stay as they were."""
        self.revision += 1
        if not changed.any():
            return
        config = self.config
        gap = round(config.max_gap / config.cell) + 1
        here, around = box_around(changed, gap), box_around(changed, 2 * gap)
        shown, felt = self._shown[around], self._felt[around]
        dropout = self.dropout[around]
        measured = np.where(dropout, np.float32(np.nan), shown)
        known = np.where(np.isnan(shown), self._assumed[around], shown)
        known[dropout] = np.nan
        for layer in (measured, known):
            np.copyto(layer, felt, where=~np.isnan(felt))
        bridged = kernels.bridge_gaps(known, dropout, gap - 1, config.max_gap_rise)
        self.measured, self.elevation = self.measured.copy(), self.elevation.copy()
        self.measured[here] = measured[inside(here, around)]
        self.elevation[here] = bridged[inside(here, around)]

    def _grow(self, xy: NDArray) -> None:
        """Make room for the points' bounding box, in whole blocks."""
        block_cells = round(self.config.block / self.config.cell)
        low, high = self.grid.cell_of(xy.min(axis=0)), self.grid.cell_of(xy.max(axis=0))
        before = np.maximum(0, -(low // block_cells))
        after = np.maximum(0, high // block_cells + 1 - np.array(self.grid.shape) // block_cells)
        if not (before.any() or after.any()):
            return
        old = self._layers
        start = before * block_cells
        inside = tuple(slice(s, s + n) for s, n in zip(start, self.grid.shape, strict=True))
        self._allocate(*(np.array(self.grid.shape) + (before + after) * block_cells))
        for layer, values in zip(self._layers, old, strict=True):
            layer[inside] = values
        self._origin = self._origin - start * self.config.cell
