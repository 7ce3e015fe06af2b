"""How high the ground is, cell by cell.

Voxels of 0.1 m cannot tell a ramp from a step, so the elevation map keeps the mean height of the returns in finer
columns.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import Grid, GridMap, Layer, box_around, inside
from pipeline.robot import RobotModel
from pipeline.traversability import elevation_kernels as kernels

CELL = 0.05
"""m, side of a cell."""

_UNKNOWN = Layer(np.float32, np.nan)


class ElevationMap:
    """A grid map of the ground that grows where points fall.

    Attributes:
        robot: gaps that it rolls over are filled, and the headroom that it needs must be free.
        layers: the tracked ones are ``measured``, ``elevation``, ``dropout`` and ``driven``.
    """

    def __init__(self, robot: RobotModel):
        self.robot = robot
        self.layers = GridMap(
            CELL,
            {
                "measured": _UNKNOWN,
                "elevation": _UNKNOWN,
                "dropout": Layer(np.bool_),
                "driven": Layer(np.bool_),
                "height": Layer(np.float32, per_cell=(kernels.LEVELS,), in_place=True),
                "hits": Layer(np.uint16, per_cell=(kernels.LEVELS,), in_place=True),
                "returned": Layer(np.float32, np.nan, in_place=True),
                "assumed": Layer(np.float32, np.nan, in_place=True),
                "touched": Layer(np.float32, np.nan, in_place=True),
                "dropout_direction": Layer(np.float32, per_cell=(2,), in_place=True),
            },
        )

    @property
    def grid(self) -> Grid:
        """Where the cells lie now."""
        return self.layers.grid

    @property
    def measured(self) -> NDArray[np.float32]:
        """(nx, ny) m, height of the ground from returns alone; NaN where there are none."""
        return self.layers["measured"]

    @property
    def elevation(self) -> NDArray[np.float32]:
        """(nx, ny) m, the same with small gaps filled and the ground assumed at the start; NaN where unknown."""
        return self.layers["elevation"]

    @property
    def dropout(self) -> NDArray[np.bool_]:
        """(nx, ny) where a thin panel may stand that sent nothing back: unknown, whatever the returns."""
        return self.layers["dropout"]

    @property
    def driven(self) -> NDArray[np.bool_]:
        """(nx, ny) where the middle of the robot has been."""
        return self.layers["driven"]

    def assume_ground(self, T_map_base: NDArray[np.float64], radius: float, ahead: float, width: float) -> None:
        """Take the ground under the robot and just before it for flat until it is measured.

        Args:
            T_map_base: pose of the robot.
            radius: of a disc around it, m.
            ahead: length of a strip that runs forward from its middle, m.
            width: of the strip, m.
        """
        centre, reach = T_map_base[:2, 3], max(radius, ahead)
        self.layers.cover(np.array([centre - reach, centre + reach]))
        cells = self.grid.centre_of(np.moveaxis(np.indices(self.grid.shape), 0, -1))
        x, y = np.moveaxis((cells - centre) @ T_map_base[:2, :2], -1, 0)
        on_strip = (x >= 0) & (x <= ahead) & (np.abs(y) <= width / 2)
        assumed = (np.hypot(x, y) <= radius) | on_strip
        self.layers["assumed"][assumed] = T_map_base[2, 3]
        self._refresh(assumed)

    def add_obstacle(self, points: NDArray[np.float64]) -> None:
        """Put an obstacle that the robot touched into the cells of (N, 3) points; no keyframe removes it."""
        self.layers.cover(points)
        i, j = self.grid.cell_of(points).T
        self.layers["touched"][i, j] = points[:, 2]
        self._refresh(~np.isnan(self.layers["touched"]))

    def add_track(self, places: NDArray[np.float64]) -> None:
        """Mark the cells of (N, 2) places where the middle of the robot was, m."""
        if len(places):
            self.layers.cover(places)
            self.layers.write("driven", True, tuple(self.grid.cell_of(places).T))

    def update(
        self,
        points: NDArray[np.float32],
        dropouts: NDArray[np.float32] | None = None,
        camera: NDArray[np.float64] | None = None,
    ) -> None:
        """Add the returns of a keyframe.

        Args:
            points: (N, 3) in ``map``; those that are not finite are ignored.
            dropouts: (M, 3) where ground should have been seen, if anywhere.
            camera: (2 or 3,) from where, m.
        """
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return
        self.layers.cover(points)
        layers, grid = self.layers, self.grid
        returns = np.zeros(grid.shape, np.int32)
        height, hits = layers["height"], layers["hits"]
        kernels.accumulate(points, grid.origin, CELL, height, hits, returns)
        kernels.extract_elevation(height, hits, returns, self.robot.headroom, layers["returned"])
        changed = returns > 0
        if dropouts is not None and camera is not None:
            changed |= self._renew_dropout(dropouts, camera, returns)
        self._refresh(changed)

    def _renew_dropout(
        self, dropouts: NDArray[np.float32], camera: NDArray[np.float64], returns: NDArray[np.int32]
    ) -> NDArray[np.bool_]:
        """(nx, ny) the cells with dropouts in this keyframe."""
        direction, origin = self.layers["dropout_direction"], self.grid.origin
        count = kernels.count_dropouts(dropouts, origin, CELL, self.layers["returned"])
        kernels.renew_dropout(direction, count, returns, camera, origin, CELL)
        self.layers.write("dropout", (direction != 0).any(axis=-1))
        return np.asarray(count > 0)

    def _refresh(self, changed: NDArray[np.bool_]) -> None:
        """Renew what follows from cells (nx, ny) that changed."""
        if not changed.any():
            return
        layers, gap = self.layers, round(self.robot.max_gap / CELL) + 1
        here, around = box_around(changed, gap), box_around(changed, 2 * gap)
        returned, touched, dropout = (layers[name][around] for name in ("returned", "touched", "dropout"))
        measured = np.where(dropout, np.float32(np.nan), returned)
        known = np.where(np.isnan(returned), layers["assumed"][around], returned)
        known[dropout] = np.nan
        for layer in (measured, known):
            np.copyto(layer, touched, where=~np.isnan(touched))
        bridged = kernels.bridge_gaps(known, dropout, gap - 1)
        layers.write("measured", measured[inside(here, around)], here)
        layers.write("elevation", bridged[inside(here, around)], here)
