"""Arenas from 2D maps in the format of ROS's map_server: a file ``map.yaml`` and its image.

Occupied pixels become walls, and the ground fills the smallest rectangle around all occupied and free pixels.
``origin`` is the pose of the lower left corner of the lower left pixel; the image's first row is the top one. In the
modes ``trinary`` and ``scale``, a pixel's occupancy is its darkness (its brightness if ``negate`` is set). In the
mode ``raw``, a pixel's value is its occupancy in percent; a value above 100 means unknown. A pixel is occupied if its
occupancy is above ``occupied_thresh``. In the mode ``trinary``, alpha is averaged with the colours, as in ROS
(http://wiki.ros.org/map_server, image_loader.cpp).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import PixelMask
from pipeline.errors import InputError
from pipeline.files import check_regular, read_text
from pipeline.transforms import FARTHEST
from sarsim.arenas.elements import TILE_SIZE, ArenaBuilder
from sarsim.arenas.raf import MAX_GEOMS
from sarsim.vetting.model_files import MAX_MODEL_BYTES

MAX_BYTES = 100_000  # bytes, maximum size of the YAML file; a typical file has seven short lines
MAX_PIXELS = 60_000_000  # Maximum area of an arena, 6,000 m², in pixels of 1 cm
WALL_HEIGHT = TILE_SIZE  # m; a NIST wall is as high as it is wide
MODES = ("trinary", "scale", "raw")
DEFAULTS = {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196, "mode": MODES[0]}
"""Default values of optional keys; map_saver writes the same values."""


@dataclass(frozen=True, eq=False)
class Map2D:
    """A 2D occupancy map, seen from above.

    Attributes:
        occupied: occupied pixels; row 0 is the bottom row, column 0 the leftmost column.
        free: free pixels; pixels that are neither occupied nor free are unknown.
        resolution: side of a pixel, m.
        origin: pose of the outer corner of pixel (0, 0): x and y in m, yaw in rad.
    """

    occupied: PixelMask
    free: PixelMask
    resolution: float
    origin: tuple[float, float, float]

    def rectangle_in_world(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Centre (2,) m in ``world`` and half sizes (2,) m of a rectangle of cells, as in :attr:`known_bounds`."""
        x, y, yaw = self.origin
        low, high = cells[:, ::-1] * self.resolution
        turn = np.array([(np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))])
        return (x, y) + turn @ (low + high) / 2, (high - low) / 2

    @property
    def known_bounds(self) -> NDArray[np.int64]:
        """(2, 2) first cell and end cell (row, column) of the smallest rectangle around all occupied and free cells.

        The end cell is excluded.
        """
        seen = np.argwhere(self.occupied | self.free)
        return np.stack([seen.min(axis=0), seen.max(axis=0) + 1])


def read_map(path: Path) -> Map2D:
    """Read a map's YAML file and its image.

    Raises:
        InputError: a file is missing, broken or too large, the image is outside the folder, or a value is invalid.
    """
    values = _yaml_values(path)
    resolution = _number(path, values, "resolution", 1e-3, FARTHEST)
    origin = values.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise InputError(f"{path}: origin must be [x, y, yaw] in m and rad, not {origin!r:.40}")
    x, y, yaw = (_checked(path, "origin", value, -FARTHEST, FARTHEST) for value in origin)
    free, occupied = (_number(path, values, name, 0.0, 1.0) for name in ("free_thresh", "occupied_thresh"))
    if free >= occupied:
        raise InputError(f"{path}: free_thresh ({free:g}) must be less than occupied_thresh ({occupied:g})")
    if values["mode"] not in MODES:
        known = f"{', '.join(MODES[:-1])} or {MODES[-1]}"
        raise InputError(f"{path}: mode must be {known}, not {str(values['mode'])[:40]!r}")
    pixels = _pixels(path, values)
    occupancy = _occupancy(pixels, str(values["mode"]), _number(path, values, "negate", 0, 1) != 0)
    occupancy = np.flipud(occupancy)
    return Map2D(occupancy > occupied, (occupancy >= 0) & (occupancy < free), resolution, (x, y, yaw))


def build_map(path: Path) -> ArenaBuilder:
    """Build the arena of a map, without marking a start.

    Raises:
        InputError: the map is invalid (see :func:`read_map`), has no walls, or needs more than ``MAX_GEOMS`` boxes.
    """
    plan = read_map(path)
    boxes = rectangles(plan.occupied)
    if not len(boxes):
        raise InputError(
            f"{path}: no pixel is occupied, so the arena would have no walls; check occupied_thresh and negate"
        )
    if len(boxes) > MAX_GEOMS:
        raise InputError(
            f"{path}: the walls need {len(boxes)} boxes, but the limit is {MAX_GEOMS}; use a coarser map"
        )
    builder, half_yaw = ArenaBuilder(path.stem), plan.origin[2] / 2
    turn = {"quat": (np.cos(half_yaw), 0.0, 0.0, np.sin(half_yaw))}
    middle, half = plan.rectangle_in_world(plan.known_bounds)
    builder.add_geom("terrain", {"pos": (*middle, 0.0), "size": (*half, 0.1)} | turn)
    reach = np.full(2, np.linalg.norm(half))
    builder.add_surroundings(middle - reach, middle + reach)
    for box in boxes:
        middle, half = plan.rectangle_in_world(box)
        builder.add_geom("wall", {"pos": (*middle, WALL_HEIGHT / 2), "size": (*half, WALL_HEIGHT / 2)} | turn)
    return builder


def rectangles(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(N, 2, 2) first and end cell (row, column; end excluded) of disjoint rectangles that cover the True cells.

    Runs of cells with the same ends in consecutive rows form one rectangle. The same is done with columns, and the
    result with fewer rectangles is returned.
    """
    rows, columns = _runs(cells), _runs(cells.T)[:, :, ::-1]
    return rows if len(rows) <= len(columns) else columns


def _runs(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(N, 2, 2) rectangles as in :func:`rectangles`, from runs along rows only."""
    done: list[tuple[tuple[int, int], tuple[int, int]]] = []
    growing: dict[tuple[int, int], int] = {}  # first row of each run, by the ends of the run
    for row, line in enumerate([*cells, np.zeros(cells.shape[1], np.bool_)]):
        edges = np.flatnonzero(np.diff(line, prepend=False, append=False)).reshape(-1, 2)
        runs = {(start, end) for start, end in edges.tolist()}
        done += [((first, run[0]), (row, run[1])) for run, first in growing.items() if run not in runs]
        growing = {run: growing.get(run, row) for run in sorted(runs)}
    return np.array(done, np.int64).reshape(-1, 2, 2)


def _yaml_values(path: Path) -> dict[str, Any]:
    try:
        values = yaml.safe_load(read_text(path, MAX_BYTES))
    except (yaml.YAMLError, RecursionError) as error:
        raise InputError(f"{path}: cannot be parsed as YAML: {' '.join(str(error).split())[:200]}") from error
    if not isinstance(values, dict) or not {"image", "resolution", "origin"} <= values.keys():
        raise InputError(f"{path}: not a 2D map: the keys image, resolution and origin are required")
    return DEFAULTS | values


def _number(path: Path, values: Mapping[str, Any], name: str, low: float, high: float) -> float:
    return _checked(path, name, values[name], low, high)


def _checked(path: Path, name: str, value: object, low: float, high: float) -> float:
    if not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(f"{path}: {name} must be a number from {low:g} to {high:g}, not {str(value)[:40]!r}")
    return float(value)


def _pixels(path: Path, values: Mapping[str, Any]) -> NDArray[np.float64]:
    """(H, W, C) channels of the image, from 0 to 255; the last of two or four channels is alpha."""
    file = path.parent / str(values["image"])
    try:
        if not file.resolve().is_relative_to(path.parent.resolve()):
            raise InputError(f"{path}: the image {file} must be in the folder of this YAML file or in a subfolder")
        check_regular(file, MAX_MODEL_BYTES)
        with Image.open(file) as image:
            if image.width * image.height > MAX_PIXELS:
                raise InputError(
                    f"{file}: has {image.width} × {image.height} pixels; the limit is {MAX_PIXELS} in all"
                )
            deep = image.mode.startswith("I")
            plain = image if deep or image.mode in ("L", "LA", "RGB", "RGBA") else image.convert(_target_mode(image))
            pixels = np.asarray(plain, np.float64)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{file}: cannot be read as an image: {' '.join(str(error).split())}") from error
    return np.atleast_3d(pixels / 257 if deep else pixels)  # from 16 bits to 8


def _target_mode(image: Image.Image) -> str:
    """The mode, L, RGB or RGBA, to which an image in any other mode is converted."""
    return "L" if image.mode == "1" else "RGBA" if "transparency" in image.info else "RGB"


def _occupancy(pixels: NDArray[np.float64], mode: str, negate: bool) -> NDArray[np.float64]:
    """(H, W) occupancy, 0 to 1, of pixels (H, W, C); negative where unknown."""
    channels = pixels.shape[2]
    colour = pixels[:, :, : channels - (channels in (2, 4) and mode != "trinary")].mean(axis=2)
    value = 255 - colour if negate else colour
    if mode == "raw":
        return np.where(value > 100, -1.0, value / 100)
    return (255 - value) / 255
