"""Frontiers, where seen ground borders on unseen ground; shared by all strategies."""

import cv2
import numpy as np
from scipy import ndimage

from pipeline.arrays import MaskLayer, Places
from pipeline.exploration.viewpoint import Context


def unseen_cells(context: Context) -> MaskLayer:
    """The cells that were not seen and may be traversable.

    Unknown ground closer to a hazard than half the robot's width is included only if paths need no margin, because
    only then can it be under a wheel.
    """
    traversability = context.traversability
    nearest = 0.0 if traversability.ignores_margin else traversability.robot.half_width
    return np.isnan(context.measured) & (traversability.to_hazard >= nearest)


def cells_touching(context: Context, cells: MaskLayer, beyond: float = 0.0) -> MaskLayer:
    """The cells from which the robot's corners may touch any of the given cells.

    Cells up to ``beyond`` m farther away are included.
    """
    reach = context.traversability.robot.corner_radius + beyond
    side = 2 * round(reach / context.traversability.grid.cell) + 1
    # OpenCV's filter is many times faster than SciPy's.
    return cv2.dilate(cells.view(np.uint8), np.ones((side, side), np.uint8)).view(np.bool_)


def find_frontiers(context: Context) -> Places:
    """(N, 3) m, a point near the centre of each connected piece of reachable ground that borders on unseen ground."""
    traversability, target = context.traversability, unseen_cells(context)
    pieces, _ = ndimage.label(cells_touching(context, target) & context.paths.reachable & ~target, np.ones((3, 3)))
    centres = []
    for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
        cells = np.argwhere(pieces[box] == piece) + [side.start for side in box]
        middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
        centres.append([*traversability.grid.centre_of(middle), traversability.elevation[tuple(middle)]])
    return np.array(centres).reshape(-1, 3)
