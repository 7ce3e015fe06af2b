"""2D maps to explore: maps drawn from a seed, ROS maps, and the dungeon maps with which papers compare methods."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import PixelMask
from pipeline.errors import InputError
from sarsim.arenas.map_2d import read_map

START_COLOUR = (255, 216, 0)
"""RGB colour of the square in which the robot starts on a dungeon map."""
START_PIXEL = 127
"""Index of the robot's pixel among the pixels of this square, in row-major order."""
LIGHT = 150
"""Grey value above which a pixel of a dungeon map is free."""
ROOMS = 14
"""Number of rooms in a drawn map; they may overlap."""
SIZES = {"camera": ((120, 160), 10, 0.1), "papers": ((480, 640), 20, 1.0)}
"""Rows and columns, width of corridors (cells) and side of a cell (m) of drawn maps, for each set of rules."""
DRAWINGS = {"train": 0, "val": 1_000_000, "test": 2_000_000}
"""The first seed of each split of the drawn maps."""


@dataclass(frozen=True, eq=False)
class GridScene:
    """A 2D map and the robot's start.

    Attributes:
        free: free cells; all others are walls. Columns are along x, rows along y.
        start: row and column of the robot's cell.
        cell: side of a cell, m.
    """

    free: PixelMask
    start: tuple[int, int]
    cell: float


def read_dungeon(path: Path) -> GridScene:
    """Read a dungeon map, a PNG image in which a pixel counts as 1 m.

    Raises:
        InputError: the image cannot be read or has no start.
    """
    try:
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: cannot be read as an image: {' '.join(str(error).split())}") from error
    square = np.argwhere((pixels == START_COLOUR).all(axis=2))
    if len(square) <= START_PIXEL:
        raise InputError(
            f"{path}: no start: at least {START_PIXEL + 1} pixels must have its colour, "
            f"RGB {START_COLOUR}, but only {len(square)} do"
        )
    row, col = square[START_PIXEL].tolist()
    return GridScene(pixels.max(axis=2) > LIGHT, (row, col), 1.0)


def dungeon_files(folder: Path) -> list[Path]:
    """The dungeon maps in a folder and its subfolders, sorted; InputError if there are none."""
    files = sorted(folder.rglob("*.png"))
    if not files:
        raise InputError(f"{folder}: contains no .png maps, not even in subfolders")
    return files


def read_ros_scene(path: Path) -> GridScene:
    """Read a ROS map (YAML and image); the robot starts in the free cell nearest to the origin of ``map``.

    Raises:
        InputError: as in :func:`sarsim.arenas.map_2d.read_map`, or no cell is free.
    """
    plan = read_map(path)
    cells = np.argwhere(plan.free)
    if not len(cells):
        raise InputError(f"{path}: the map has no free pixels, so there is no place for the robot to start")
    x, y, yaw = plan.origin
    turn = np.array([(np.cos(yaw), np.sin(yaw)), (-np.sin(yaw), np.cos(yaw))])
    origin = (turn @ (-x, -y))[::-1] / plan.resolution - 0.5
    row, col = cells[np.linalg.norm(cells - origin, axis=1).argmin()].tolist()
    return GridScene(plan.free, (row, col), plan.resolution)


def draw_scene(seed: int, shape: tuple[int, int], lane: int, cell: float) -> GridScene:
    """Draw rooms, joined into a chain with some loops by corridors ``lane`` cells wide; the robot starts in a room.

    Args:
        seed: the same seed draws the same map.
        shape: rows and columns of the map.
        lane: width of corridors, cells; rooms are 2 to 6 times as wide.
        cell: side of a cell, m.
    """
    rng = np.random.default_rng(seed)
    free = np.zeros(shape, np.bool_)
    centres = [_draw_room(rng, free, lane) for _ in range(ROOMS)]
    joined = [(a, b) for a, b in pairwise(_near_each_other(centres))]
    loops = [tuple(rng.choice(ROOMS, 2, replace=False)) for _ in range(ROOMS // 4)]
    for a, b in [*joined, *((centres[i], centres[j]) for i, j in loops)]:
        _draw_corridor(rng, free, a, b, lane)
    return GridScene(free, centres[0], cell)


def _draw_room(rng: np.random.Generator, free: NDArray[np.bool_], lane: int) -> tuple[int, int]:
    """Clear a rectangle or an ellipse; returns its centre."""
    half = rng.integers(lane, 3 * lane, 2, endpoint=True)
    middle = rng.integers(half + lane, np.array(free.shape) - half - lane)
    rows, cols = np.ogrid[: free.shape[0], : free.shape[1]]
    y, x = (rows - middle[0]) / half[0], (cols - middle[1]) / half[1]
    free |= (np.maximum(abs(x), abs(y)) <= 1) if rng.random() < 0.5 else (x**2 + y**2 <= 1)
    return int(middle[0]), int(middle[1])


def _near_each_other(centres: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The centres of rooms in greedy order: each is followed by the nearest of those that remain."""
    left, order = list(centres[1:]), [centres[0]]
    while left:
        order.append(min(left, key=lambda c: (np.hypot(c[0] - order[-1][0], c[1] - order[-1][1]), c)))
        left.remove(order[-1])
    return order


def _draw_corridor(
    rng: np.random.Generator, free: NDArray[np.bool_], a: tuple[int, int], b: tuple[int, int], lane: int
) -> None:
    """Clear a corridor with one bend."""
    corner = (a[0], b[1]) if rng.random() < 0.5 else (b[0], a[1])
    before = (lane - 1) // 2
    for p, q in ((a, corner), (corner, b)):
        low, high = np.minimum(p, q) - before, np.maximum(p, q) - before + lane
        free[low[0] : high[0], low[1] : high[1]] = True
