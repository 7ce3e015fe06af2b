"""How high the ground is, cell by cell.

Voxels of 0.1 m cannot tell a ramp from a step, so the elevation map keeps the mean height of the returns in finer
columns.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from types import EllipsisType

import numpy as np
from numpy.typing import NDArray

from pipeline.grid_map import Grid, GridMap, Layer, box_around, inside
from pipeline.robot import RobotModel
from pipeline.traversability import elevation_kernels as kernels

CELL = 0.05
"""m, side of a cell."""

POSE_ERROR = 0.05
"""m by which the radius of the disc that the robot certainly swept is smaller than half the footprint's width."""

HEIGHTS = kernels.Z_MIN, kernels.Z_MIN + kernels.LEVELS * kernels.Z_BIN
"""m in ``map``, between which ground is mapped."""

_UNKNOWN = Layer(np.float32, np.nan)


class ElevationMap:
    """A grid map of the ground that grows where points fall.

    Attributes:
        robot: its ``max_gap`` is the widest gap that is filled, its ``headroom`` the free height above the ground.
        layers: changes are tracked of ``measured``, ``elevation``, ``dropout`` and ``driven``.
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
                "ceiling": Layer(np.float32, np.inf, in_place=True),
                "returned": Layer(np.float32, np.nan, in_place=True),
                "assumed": Layer(np.float32, np.nan, in_place=True),
                "touched": Layer(np.float32, np.nan, in_place=True),
                "dropout_direction": Layer(np.float32, per_cell=(2,), in_place=True),
                "been": Layer(np.bool_, in_place=True),
                "swept": Layer(np.bool_, in_place=True),
                # Counts of the keyframe that is being added; 0 otherwise.
                "returns": Layer(np.int32, in_place=True),
                "dropouts": Layer(np.int32, in_place=True),
            },
        )
        self._is_making = False

    @property
    def grid(self) -> Grid:
        """Where the cells lie now."""
        return self.layers.grid

    @property
    def measured(self) -> NDArray[np.float32]:
        """(nx, ny) m, height of the ground where it was seen or touched; NaN elsewhere."""
        return self.layers["measured"]

    @property
    def elevation(self) -> NDArray[np.float32]:
        """(nx, ny) m, ``measured`` with small gaps filled and the ground assumed at the start; NaN where unknown."""
        return self.layers["elevation"]

    @property
    def dropout(self) -> NDArray[np.bool_]:
        """(nx, ny) where a thin panel without returns may stand: the ground is unknown there, whatever was seen."""
        return self.layers["dropout"]

    @property
    def driven(self) -> NDArray[np.bool_]:
        """(nx, ny) where the middle of the robot has been."""
        return self.layers["driven"]

    def assume_ground(self, points: NDArray[np.floating]) -> None:
        """Take the cells of (N, 3) points for ground as high as the points until it is measured."""
        self._set("assumed", points)

    def add_obstacle(self, points: NDArray[np.floating]) -> None:
        """Put an obstacle that the robot touched into the cells of (N, 3) points; no keyframe removes it."""
        self._set("touched", points)

    def _set(self, layer: str, points: NDArray[np.floating]) -> None:
        if not len(points):
            return
        self.layers.cover(points)
        i, j = self.grid.cell_of(points).T
        self.layers[layer][i, j] = points[:, 2]
        self._renew((i, j))

    def add_track(self, places: NDArray[np.float64]) -> None:
        """Mark the cells of (N, 2) places of the robot's middle, m; the cells that it swept hold no panel."""
        if not len(places):
            return
        reach = self._disc.max() * CELL
        self.layers.cover(np.vstack([places - reach, places + reach]))
        cells = self.grid.cell_of(places)
        self.layers["been"][tuple(cells.T)] = True
        swept = tuple((cells[:, None] + self._disc).reshape(-1, 2).T)
        self.layers["swept"][swept] = True
        self._renew(swept)

    @cached_property
    def _disc(self) -> NDArray[np.int64]:
        """(K, 2) the cells that a robot in the middle of cell (0, 0) certainly sweeps."""
        reach = max(self.robot.half_width - POSE_ERROR, 0.0)
        square = np.argwhere(np.ones((2 * int(reach / CELL) + 1,) * 2)) - int(reach / CELL)
        return square[np.hypot(*square.T) * CELL <= reach]

    def update(
        self,
        points: NDArray[np.float32],
        dropouts: NDArray[np.float32] | None = None,
        camera: NDArray[np.float64] | None = None,
        hits: NDArray[np.uint32] | None = None,
        dropout_hits: NDArray[np.uint32] | None = None,
    ) -> None:
        """Add the returns of a keyframe.

        Args:
            points: (N, 3) in ``map``, m; points that are not finite are ignored.
            dropouts: (M, 3) m, where ground should have been seen and was not.
            camera: (3,) position of the camera, m; without it no gap is filled for what these points show.
            hits, dropout_hits: (N,) and (M,) uint32, number of pixels that each point is the mean of; 1 if not given.
        """
        is_finite = np.isfinite(points).all(axis=1)
        points, counts = points[is_finite], _counts(points, hits)[is_finite]
        if not len(points):
            return
        seen_from = np.zeros((0, 2)) if camera is None else camera[None, :2]
        corners = np.vstack([points[:, :2].min(axis=0), points[:, :2].max(axis=0), seen_from])
        self.layers.cover(corners)
        layers, origin, headroom = self.layers, self.grid.origin, self.robot.headroom
        height, filled, returns = (layers[name] for name in ("height", "hits", "returns"))
        cells = kernels.accumulate(points, counts, origin, CELL, height, filled, returns)
        if camera is not None:
            kernels.lower_ceiling(layers["ceiling"], points, camera, origin, CELL)
            # The ground is renewed where rays passed, too.
            cells = np.concatenate([cells, self.grid.cell_of(corners)])
        if dropouts is not None and camera is not None:
            count, direction = layers["dropouts"], layers["dropout_direction"]
            weights = _counts(dropouts, dropout_hits)
            missing = kernels.count_dropouts(dropouts, weights, origin, CELL, height, filled, headroom, count)
            cells = np.concatenate([cells, missing])
            kernels.renew_dropout(direction, count, returns, cells, camera, origin, CELL)
            count[tuple(missing.T)] = 0
        where = tuple(cells.T)
        returns[where] = 0
        self._renew(where)

    @contextmanager
    def made_anew(self) -> Iterator[None]:
        """Forget everything; afterwards the map holds only what the block of the ``with`` statement adds."""
        layers = self.layers
        for name in ("height", "hits", "been", "swept", "dropout_direction"):
            layers[name].fill(0)
        for name in ("returned", "assumed", "touched"):
            layers[name].fill(np.nan)
        layers["ceiling"].fill(np.inf)
        self._is_making = True
        yield
        self._is_making = False
        self._renew(...)

    def _renew(self, where: tuple[NDArray, ...] | EllipsisType) -> None:
        """Renew what follows from the evidence, in and around cells that it changed, an index of a layer."""
        layers, gap = self.layers, round(self.robot.max_gap / CELL) + 1
        changed = np.zeros(self.grid.shape, np.bool_)
        changed[where] = True
        if self._is_making or not changed.any():
            return
        columns, cells = (layers["height"], layers["hits"]), np.argwhere(changed)
        kernels.extract_elevation(*columns, cells, self.robot.headroom, layers["returned"])
        layers.write("driven", layers["been"][where], where)
        # A panel may stand wherever the robot has not been.
        missing = layers["dropout_direction"][where].any(axis=-1)
        layers.write("dropout", missing & ~layers["swept"][where], where)
        here, around = box_around(changed, gap), box_around(changed, 2 * gap)
        names = ("returned", "touched", "assumed", "dropout", "ceiling")
        returned, touched, assumed, dropout, ceiling = (layers[name][around] for name in names)
        measured = np.where(np.isnan(touched), np.where(dropout, np.float32(np.nan), returned), touched)
        known = np.where(np.isnan(measured) & ~dropout, assumed, measured)
        bridged = kernels.bridge_gaps(known, dropout, ceiling, gap - 1)
        layers.write("measured", measured[inside(here, around)], here)
        layers.write("elevation", bridged[inside(here, around)], here)


def _counts(points: NDArray[np.float32], hits: NDArray[np.uint32] | None) -> NDArray[np.uint32]:
    """(N,) number of pixels that each of (N, 3) points is the mean of."""
    return np.ones(len(points), np.uint32) if hits is None else hits
