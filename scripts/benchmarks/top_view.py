"""Top view of a run: the true ground, its seen cells, the true trajectory, collisions and failed legs."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import MaskLayer, Place, Places, Rgb
from pipeline.grid_map import Grid
from sarsim.ground_truth.true_surface import GroundTruthSurface

PICTURE_LENGTH = 900  # Maximum pixels of the arena's longer side
MOST_PIXELS = 8  # Maximum pixels per side of a cell
BAND = 26  # Height of a line of text below the picture, pixels

# Colours are RGB.
NOWHERE, GROUND, WALL = (226, 226, 226), (250, 250, 250), (40, 40, 40)
UNSEEN, SEEN = (255, 170, 150), (190, 228, 190)
WAY, START, END = (30, 80, 200), (255, 255, 255), (30, 80, 200)
CONTACT, FAILED = (220, 0, 0), (160, 0, 200)


def top_view(
    surface: GroundTruthSurface,
    seen: MaskLayer,
    way: Places,
    contacts: Sequence[Place],
    failed: Sequence[Place],
    text: str,
) -> Rgb:
    """Top view of a run, with x to the right and y up.

    Args:
        surface: the true ground; seen drivable cells are green, others red.
        seen: the seen cells, on the grid of ``surface``.
        way: the robot's true trajectory.
        contacts: the robot's positions at collisions, each (2,), m; red crosses.
        failed: targets of legs that were not reached, each (2,), m; violet diamonds.
        text: the line of text below the picture.
    """
    picture, scale = ground_picture(surface, seen)
    line = pixels(surface.grid, scale, way)
    cv2.polylines(picture, [line], False, WAY, 1, cv2.LINE_AA)
    cv2.circle(picture, line[0].tolist(), 5, START, cv2.FILLED, cv2.LINE_AA)
    cv2.circle(picture, line[0].tolist(), 5, WAY, 1, cv2.LINE_AA)
    cv2.circle(picture, line[-1].tolist(), 5, END, cv2.FILLED, cv2.LINE_AA)
    for place, colour, marker in (
        *((c, CONTACT, cv2.MARKER_TILTED_CROSS) for c in contacts),
        *((f, FAILED, cv2.MARKER_DIAMOND) for f in failed),
    ):
        cv2.drawMarker(picture, pixels(surface.grid, scale, place).tolist(), colour, marker, 10, 2, cv2.LINE_AA)
    return np.vstack([picture, caption(text, picture.shape[1])])


def ground_picture(surface: GroundTruthSurface, seen: NDArray[np.bool_]) -> tuple[NDArray[np.uint8], int]:
    """(H, W, 3) uint8 RGB picture of the ground, given its (nx, ny) ``seen`` cells, and pixels per side of a cell."""
    scale = int(np.clip(PICTURE_LENGTH // max(surface.grid.shape), 1, MOST_PIXELS))
    cells = _cells(surface, seen).transpose(1, 0, 2)[::-1]
    return np.ascontiguousarray(cells.repeat(scale, axis=0).repeat(scale, axis=1)), scale


def _cells(surface: GroundTruthSurface, seen: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(nx, ny, 3) uint8 RGB colour of every cell."""
    cells = np.empty((*surface.grid.shape, 3), np.uint8)
    cells[:] = NOWHERE
    cells[~np.isnan(surface.height)] = GROUND
    cells[surface.drivable] = UNSEEN
    cells[surface.drivable & seen] = SEEN
    cells[surface.walls] = WALL
    return cells


def pixels(grid: Grid, scale: int, xy: NDArray[np.float64]) -> NDArray[np.int32]:
    """(..., 2) column and row, pixels, of points (..., 2) in the world, m."""
    column, row = np.moveaxis((np.asarray(xy) - grid.origin) / grid.cell * scale, -1, 0)
    return np.stack([column, grid.shape[1] * scale - row], axis=-1).astype(np.int32)


def caption(text: str, width: int) -> NDArray[np.uint8]:
    """(BAND, width, 3) uint8 RGB picture of a line of text."""
    band = np.full((BAND, width, 3), 255, np.uint8)
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.45
    fitting = min(1.0, (width - 12) / cv2.getTextSize(text, font, size, 1)[0][0])
    cv2.putText(band, text, (6, BAND - 9), font, size * fitting, (0, 0, 0), 1, cv2.LINE_AA)
    return band
