"""Whether ground leads up to a surface, which is the only difference between a drivable deck and a table."""

from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Mask, Places, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.geometry.parts import part_numbers


def is_inaccessible(
    ground: Traversability, places: Places, points: NDArray[np.floating], from_below: Mask | np.bool_ = np.False_
) -> Mask:
    """(N,) whether points that look like ramps or decks cannot carry the robot, for one of two reasons.

    A point may be farther than half the robot's width from every square with this side length on the points'
    surface, as on the feet of a chair. Or a point may be higher than the headroom above the nearest ground that the
    robot can reach, and belong to no surface that comes down to this ground, as every ramp does, however steep.

    Args:
        ground: traversability of the ground.
        places: positions where the robot has been, (K, 3).
        points: (N, 3) points labelled as ramps and decks, m.
        from_below: (N,) whether a point belongs to a deck seen from below; the ground that leads up to such a deck
            may not have been in view.
    """
    cells = np.clip(ground.grid.cell_of(points), 0, np.subtract(ground.grid.shape, 1))
    surface = np.zeros(ground.grid.shape, bool)
    surface[tuple(cells.T)] = True
    side = ceil(ground.robot.width / 2 / ground.grid.cell)
    broad = ndimage.binary_opening(surface, np.ones((side, side)))
    near = ndimage.binary_dilation(broad, np.ones((2 * side - 1, 2 * side - 1)))
    narrow, height = ~near[tuple(cells.T)], height_above_accessible(ground, places, points)
    high = (height > ground.robot.headroom) & ~from_below
    return narrow | high & ~_comes_down(points, ~narrow, height, 2 * ground.grid.cell) if high.any() else narrow


def _comes_down(points: NDArray[np.floating], counts: Mask, height: Values, joint: float) -> Mask:
    """(N,) whether points (N, 3), m, of the mask ``counts`` are on a surface that comes down to almost no ``height``.

    ``joint``: side of the voxels that form one surface if adjacent, and maximum ``height`` of the surface's lowest
    point, m.
    """
    part_of = np.zeros(len(points), np.intp)
    part_of[counts] = part_numbers(points[counts] - points.min(axis=0), joint)
    return counts & np.isin(part_of, part_of[counts & (height < joint)])


def height_above_accessible(ground: Traversability, places: Places, points: NDArray[np.floating]) -> Values:
    """(N,) m, height of points (N, 3) above the nearest ground that the robot can reach without crossing a hazard.

    The camera does not see the ground under the robot, so all ground at the same height is included. Without such
    ground, the result is 0.

    ``places``: positions where the robot has been, (K, 3).
    """
    pieces, _ = ndimage.label(~ground.hazard & ~np.isnan(ground.elevation), np.ones((3, 3)))
    level, stood = (np.round(z / ground.robot.max_step) for z in (ground.elevation, places[:, 2]))
    stood_on = np.unique(pieces[np.isin(level, stood[:, None] + (-1, 0, 1))])
    reached = np.isin(pieces, stood_on[stood_on > 0])
    if not reached.any():
        return np.zeros(len(points))
    nearest = ndimage.distance_transform_edt(~reached, return_distances=False, return_indices=True)
    cells = np.clip(ground.grid.cell_of(points), 0, np.subtract(ground.grid.shape, 1))
    return points[:, 2] - ground.elevation[tuple(nearest)][tuple(cells.T)]
