"""Upright surfaces in a labelled map, seen from above: walls are flat and wide; a ramp's side ends at the ramp's top.

A network sees only a piece of each surface, whereas the map shows its full extent. Surfaces that are round or
narrower than half of the robot, such as posts, barrels, and legs of tables and decks, are not walls. A narrow surface
labelled as a ramp is the side of the nearest ramp or deck, and so is a wall that ends at the height of this ramp's
top.
"""

from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Indices, Labels, Layer, Mask, MaskLayer, Points
from pipeline.labels import Label
from pipeline.robot import RobotModel
from pipeline.semantic_map.uprights_kernels import directions, is_on_long_run

REACH = 2
"""Distance up to which points around a cell determine the direction of a wall, cells.

With a smaller distance, noise would dominate. Within this distance of a corner, the directions of both walls mix.
"""
BLUR = 2
"""Uncertainty of the edge of a ramp's top, cells: one cell due to noise, and one cell due to the grid."""
RAMPS = Label.INCLINED_RAMP, Label.STRAIGHT_RAMP


@dataclass(frozen=True, eq=False)
class TopDownProjection:
    """Points in the cells of a grid, seen from above.

    Attributes:
        cell: edge length of a cell, m.
        shape: number of cells along x and y.
        of_point: flat index of every point's cell.
        height: (N,) float32 height of every point, m.
    """

    cell: float
    shape: tuple[int, int]
    of_point: Indices
    height: NDArray[np.float32]

    @classmethod
    def of(cls, points: Points, cell: float) -> Self:
        """Assign points, at least one, to cells with an edge length of ``cell`` m."""
        cells = np.floor(points[:, :2] / cell).astype(np.int64)
        i, j = (cells - cells.min(axis=0)).T
        shape = int(i.max()) + 1, int(j.max()) + 1
        return cls(cell, shape, i * shape[1] + j, points[:, 2])

    def counts(self, chosen: Mask) -> NDArray[np.int32]:
        """(nx, ny) number of the ``chosen`` points in every cell."""
        counts = np.bincount(self.of_point[chosen], minlength=self.shape[0] * self.shape[1])
        return counts.astype(np.int32).reshape(self.shape)

    def span(self, chosen: Mask) -> tuple[Layer, Layer]:
        """The heights of the lowest and the highest of the ``chosen`` points in every cell, m.

        In a cell without chosen points, the lowest is 1 m above all points and the highest 1 m below them.
        """
        beyond = self.height.max() + 1, self.height.min() - 1
        lowest, highest = (np.full(self.shape, z, np.float32) for z in beyond)
        np.minimum.at(lowest.ravel(), self.of_point[chosen], self.height[chosen])
        np.maximum.at(highest.ravel(), self.of_point[chosen], self.height[chosen])
        return lowest, highest

    def at_points(self, layer: NDArray) -> NDArray:
        """(N,) values of a layer (nx, ny) in the points' cells."""
        return layer.ravel()[self.of_point]


def with_whole_uprights(points: Points, labels: Labels, robot: RobotModel, voxel: float, cell: float) -> Labels:
    """Labels of a map's points, corrected for walls and for the sides of ramps and decks.

    Args:
        points: points of the map.
        labels: labels of these points.
        robot: the robot, whose dimensions limit the dimensions of walls and sides.
        voxel: edge length of the map's voxels, m.
        cell: edge length of cells that are all filled where a surface has no holes, m.
    """
    if not len(points):
        return labels
    fine, coarse = (TopDownProjection.of(points, edge) for edge in (voxel, cell))
    of_walls = with_whole_walls(fine, labels, robot.width / 2, robot.max_gap)
    return with_sides_of_ramps(coarse, of_walls, robot.headroom)


def with_whole_walls(plan: TopDownProjection, labels: Labels, width: float, gap: float) -> Labels:
    """Labels in which all walls are flat and at least ``width`` m wide; other walls become clutter.

    The direction of a wall is found from the points close to a cell or, if the wall has gaps of up to ``gap`` m
    between slats, in a neighbourhood ``width`` m wide. Clutter in a wall becomes wall where wall points prevail.
    """
    is_wall, is_clutter = labels == Label.WALL, labels == Label.CLUTTER
    walls, length = plan.counts(is_wall), ceil(width / plan.cell)
    # Cells of one run stay in line across a gap: over the gap's length, their directions diverge by at most a cell.
    tolerance, max_gap = plan.cell / gap, int(gap / plan.cell)
    reaches = REACH, length // 2
    wide = [is_on_long_run(directions(walls, reach), length, max_gap, tolerance) for reach in reaches]
    whole = ndimage.binary_dilation(np.logical_or(*wide), _square_of_ones(REACH))
    mostly = ndimage.convolve(walls, _square_of_ones(1)) > ndimage.convolve(
        plan.counts(is_clutter), _square_of_ones(1)
    )
    result = labels.copy()
    result[is_wall & ~plan.at_points(whole)] = Label.CLUTTER
    result[is_clutter & plan.at_points(whole & mostly)] = Label.WALL
    return result


def with_sides_of_ramps(plan: TopDownProjection, labels: Labels, headroom: float) -> Labels:
    """Labels in which the sides of a ramp or deck have the label of its top, the nearest broad surface.

    Surfaces at least ``headroom`` m high are not sides, because the robot can drive under a deck of this height.
    """
    is_ramp, is_wall = np.isin(labels, RAMPS), labels == Label.WALL
    low, high = plan.span(is_ramp)
    is_deck = 2 * plan.counts(labels == Label.STRAIGHT_RAMP) > plan.counts(is_ramp)
    is_filled, is_level = low <= high, high - low <= plan.cell
    top = _broad_parts(is_filled & is_level & is_deck) | _broad_parts(is_filled & is_level & ~is_deck)
    if not top.any():
        return labels
    distance, (i, j) = ndimage.distance_transform_edt(~top, return_indices=True)
    surface, _ = ndimage.label(is_filled, _square_of_ones(1))
    narrow = (surface == surface[i, j]) & ~top & (high - low < headroom)
    # A side ends at the height of the highest top around it.
    edge = ndimage.maximum_filter(np.where(top, high, low.min() - 1), len(_square_of_ones(BLUR)))
    side = _ends_at(edge, *plan.span(is_ramp | is_wall), plan.cell, headroom) & (distance <= BLUR)
    is_side = is_ramp & plan.at_points(narrow) | is_wall & plan.at_points(side)
    label = np.where(is_deck[i, j], Label.STRAIGHT_RAMP, Label.INCLINED_RAMP)
    return np.where(is_side, plan.at_points(label), labels).astype(np.uint8)


def _ends_at(edge: Layer, low: Layer, high: Layer, step: float, headroom: float) -> MaskLayer:
    """Cells in which an upright surface from ``low`` to ``high``, m, ends at ``edge``, m.

    The surface is between ``step`` and ``headroom``, m, in height, and its end at most ``step`` from the edge.
    """
    height = high - low
    return (height > step) & (height < headroom) & (np.abs(high - edge) <= step)


def _broad_parts(layer: MaskLayer) -> MaskLayer:
    """Cells of a layer that belong to a filled square of 3 × 3 cells, in which single cells may be missing."""
    return layer & ndimage.binary_opening(ndimage.binary_closing(layer, _square_of_ones(1)), _square_of_ones(1))


def _square_of_ones(reach: int) -> NDArray[np.int32]:
    """A square of ones that extends ``reach`` cells from its centre along each axis."""
    return np.ones((2 * reach + 1, 2 * reach + 1), np.int32)
