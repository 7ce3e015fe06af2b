"""What stands upright in a labelled map, seen from above: a wall is flat and wide, a ramp's side ends at its top.

A network sees a piece of a surface at a time; only the map shows how far the surface goes. What is narrower than half
of the robot, or round, is no wall: posts, legs of tables and decks, barrels. What is labelled as a ramp and is not
broad is the side of the nearest ramp or deck, and so is a wall that ends at its height.
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
from pipeline.semantic_map.config import SemanticMapConfig, UprightsConfig
from pipeline.semantic_map.uprights_kernels import directions, on_long_runs

RAMPS = Label.INCLINED_RAMP, Label.STRAIGHT_RAMP


@dataclass(frozen=True, eq=False)
class SeenFromAbove:
    """Points in the cells of a grid, seen from above.

    Attributes:
        cell: m.
        shape: of the grid.
        of_point: flat index of every point's cell.
        height: (N,) float32 m of every point.
    """

    cell: float
    shape: tuple[int, int]
    of_point: Indices
    height: NDArray[np.float32]

    @classmethod
    def of(cls, points: Points, cell: float) -> Self:
        """Of points, at least one."""
        cells = np.floor(points[:, :2] / cell).astype(np.int64)
        i, j = (cells - cells.min(axis=0)).T
        shape = int(i.max()) + 1, int(j.max()) + 1
        return cls(cell, shape, i * shape[1] + j, points[:, 2])

    def counts(self, chosen: Mask) -> NDArray[np.int32]:
        """(nx, ny) number of the ``chosen`` points in every cell."""
        counts = np.bincount(self.of_point[chosen], minlength=self.shape[0] * self.shape[1])
        return counts.astype(np.int32).reshape(self.shape)

    def span(self, chosen: Mask) -> tuple[Layer, Layer]:
        """The height in m of the lowest and the highest of the ``chosen`` points in every cell.

        A cell without any has a span from 1 m above all points to 1 m below them.
        """
        beyond = self.height.max() + 1, self.height.min() - 1
        lowest, highest = (np.full(self.shape, z, np.float32) for z in beyond)
        np.minimum.at(lowest.ravel(), self.of_point[chosen], self.height[chosen])
        np.maximum.at(highest.ravel(), self.of_point[chosen], self.height[chosen])
        return lowest, highest

    def at_points(self, layer: NDArray) -> NDArray:
        """(N,) values of a layer (nx, ny) in the points' cells."""
        return layer.ravel()[self.of_point]


def with_whole_uprights(
    points: Points, labels: Labels, robot: RobotModel, cell: float, config: SemanticMapConfig
) -> Labels:
    """Labels of a map's points in which walls, and the sides of ramps and decks, are whole and nothing else is.

    Args:
        points: of the map.
        labels: theirs.
        robot: by its size.
        cell: m, of the plan in which a surface without holes fills all cells.
        config: of the map.
    """
    if not len(points):
        return labels
    fine, coarse = (SeenFromAbove.of(points, edge) for edge in (config.voxel, cell))
    of_walls = with_whole_walls(fine, labels, robot.width / 2, robot.max_gap, config.uprights)
    return with_sides_of_ramps(coarse, of_walls, robot.headroom, config.uprights)


def with_whole_walls(plan: SeenFromAbove, labels: Labels, width: float, gap: float, config: UprightsConfig) -> Labels:
    """Labels in which walls are flat and at least ``width`` m wide; others are clutter.

    Which way a wall runs shows around its cells or, if it has gaps of up to ``gap`` m between slats, in a
    neighbourhood as wide as a wall must be. Clutter in a cell of a wall, of which most is a wall, becomes one.
    """
    is_wall, is_clutter = labels == Label.WALL, labels == Label.CLUTTER
    walls, length = plan.counts(is_wall), ceil(width / plan.cell)
    # Cells of one run stay in a line over a gap: there, their directions part by less than a cell.
    tolerance, most_gap = plan.cell / gap, int(gap / plan.cell)
    reaches = config.reach, length // 2
    wide = [on_long_runs(directions(walls, reach), length, most_gap, tolerance) for reach in reaches]
    whole = ndimage.binary_dilation(np.logical_or(*wide), _square(config.reach))
    mostly = ndimage.convolve(walls, _square(1)) > ndimage.convolve(plan.counts(is_clutter), _square(1))
    result = labels.copy()
    result[is_wall & ~plan.at_points(whole)] = Label.CLUTTER
    result[is_clutter & plan.at_points(whole & mostly)] = Label.WALL
    return result


def with_sides_of_ramps(plan: SeenFromAbove, labels: Labels, headroom: float, config: UprightsConfig) -> Labels:
    """Labels in which the sides of a ramp or deck have the label of its top, of the nearest that is broad.

    What is ``headroom`` m high is no side: the robot can get under a deck as high as that.
    """
    is_ramp, is_wall = np.isin(labels, RAMPS), labels == Label.WALL
    low, high = plan.span(is_ramp)
    is_deck = 2 * plan.counts(labels == Label.STRAIGHT_RAMP) > plan.counts(is_ramp)
    is_filled, is_level = low <= high, high - low <= plan.cell
    top = _broad(is_filled & is_level & is_deck) | _broad(is_filled & is_level & ~is_deck)
    if not top.any():
        return labels
    distance, (i, j) = ndimage.distance_transform_edt(~top, return_indices=True)
    surface, _ = ndimage.label(is_filled, _square(1))
    narrow = (surface == surface[i, j]) & ~top & (high - low < headroom)
    # What stands there ends at the highest top around it.
    edge = ndimage.maximum_filter(np.where(top, high, low.min() - 1), len(_square(config.blur)))
    side = _ends_at(edge, *plan.span(is_ramp | is_wall), plan.cell, headroom) & (distance <= config.blur)
    is_side = is_ramp & plan.at_points(narrow) | is_wall & plan.at_points(side)
    label = np.where(is_deck[i, j], Label.STRAIGHT_RAMP, Label.INCLINED_RAMP)
    return np.where(is_side, plan.at_points(label), labels).astype(np.uint8)


def _ends_at(edge: Layer, low: Layer, high: Layer, step: float, headroom: float) -> MaskLayer:
    """Cells in which what stands from ``low`` to ``high``, m, ends at ``edge``, m.

    ``step``, m, is the least height of what stands upright, and how far its end may be from the edge; ``headroom``,
    m, is its greatest height.
    """
    height = high - low
    return (height > step) & (height < headroom) & (np.abs(high - edge) <= step)


def _broad(layer: MaskLayer) -> MaskLayer:
    """Cells of a layer within a square of 3 × 3 cells of it, in which single ones may be missing."""
    return layer & ndimage.binary_opening(ndimage.binary_closing(layer, _square(1)), _square(1))


def _square(reach: int) -> NDArray[np.int32]:
    """Ones in the cells up to ``reach`` cells from a cell along each axis."""
    return np.ones((2 * reach + 1, 2 * reach + 1), np.int32)
