"""Heightmaps: pictures whose brightness is the height of the ground, split into tiles that become height fields."""

from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.arrays import Places, Pose
from pipeline.errors import InputError
from pipeline.transforms import from_rotation, transform_places
from sarsim.arenas.sdf.resources import MissingError, Resources
from sarsim.arenas.sdf.values import child_numbers

if TYPE_CHECKING:
    from pathlib import Path
    from xml.etree.ElementTree import Element

IMAGE_EXTENSIONS = (".png", ".jpg", ".jpeg", ".bmp", ".pgm")
"""Extensions of supported files; geographic rasters are not supported."""
MAX_PIXELS = 1025**2  # pixels, maximum size of a heightmap: the largest size in Gazebo's documentation
TILE_SIDE = 2.0  # m, approximate side of a tile; each tile has its own label
MAX_TILES = 40  # Maximum number of tiles along an axis
BASE_THICKNESS = 1.0  # m, thickness of a height field below its lowest point, so that nothing falls through


@dataclass(frozen=True, eq=False)
class GroundTile:
    """A rectangular part of a heightmap.

    Attributes:
        T_world: pose of the tile's centre, at height 0 of the map.
        half: (2,) m, half sizes along x and y.
        heights: (rows, columns) m, heights of the points; x increases with the column and y with the row.
    """

    T_world: Pose
    half: NDArray[np.float64]
    heights: NDArray[np.float64]

    @property
    def corners(self) -> Places:
        """(N, 3) m, points of the surface in the tile's frame."""
        x, y = (np.linspace(-h, h, n) for h, n in zip(self.half, self.heights.shape[::-1], strict=True))
        return np.stack([*np.meshgrid(x, y), self.heights], axis=-1).reshape(-1, 3)

    def height_at(self, x: float, y: float) -> float | None:
        """World z, m, of the surface point nearest to a position in the world; None if outside the tile."""
        along = self.T_world[:3, :3].T @ (np.array([x, y, self.T_world[2, 3]]) - self.T_world[:3, 3])
        column, row = (along[:2] / self.half + 1) / 2 * (np.array(self.heights.shape[::-1]) - 1)
        rows, columns = self.heights.shape
        if not (0 <= column <= columns - 1 and 0 <= row <= rows - 1):
            return None
        return float(self.heights[round(row), round(column)] + self.T_world[2, 3])

    @property
    def normal_z(self) -> float:
        """z component of the unit normal of the tile's mean plane, in the world."""
        step = 2 * self.half[::-1] / (np.array(self.heights.shape) - 1)
        along_y, along_x = (float(np.diff(self.heights, axis=axis).mean() / step[axis]) for axis in (0, 1))
        normal = self.T_world[:3, :3] @ (-along_x, -along_y, 1.0)
        return float(normal[2] / np.linalg.norm(normal))


class HeightmapGround:
    """The ground that a world's heightmaps form."""

    def __init__(self, tiles: list[GroundTile]):
        self._tiles = tiles
        corners = [transform_places(tile.T_world, tile.corners)[:, :2] for tile in tiles]
        self._low = np.array([c.min(axis=0) for c in corners]).reshape(-1, 2)
        self._high = np.array([c.max(axis=0) for c in corners]).reshape(-1, 2)

    def height_at(self, x: float, y: float) -> float | None:
        """World z, m, of the highest surface at a position in the world; None if there is no heightmap there."""
        around = ((self._low <= (x, y)) & (self._high >= (x, y))).all(axis=1)
        heights = [self._tiles[n].height_at(x, y) for n in np.flatnonzero(around)]
        return max((height for height in heights if height is not None), default=None)


def tiles_of(form: "Element", T_world: Pose, base: "Path", resources: Resources, where: str) -> list[GroundTile]:
    """The tiles of a ``<heightmap>`` in a shape with pose ``T_world``, from a file in folder ``base``.

    As in Gazebo, the brightest pixel has the height in ``<size>`` and black has height 0, or the reverse if that
    height is negative. The picture fills the rectangle in ``<size>``, with its upper edge towards +y.

    Raises:
        InputError: the picture is missing, of an unsupported type or too large, or a number is invalid.
    """
    uri = (form.findtext("uri") or "").strip()
    path = resources.find(uri, base, where)
    if path is None or path.is_dir():
        raise MissingError(uri, where)
    if path.suffix.lower() not in IMAGE_EXTENSIONS:
        known = f"{', '.join(IMAGE_EXTENSIONS[:-1])} or {IMAGE_EXTENSIONS[-1]}"
        raise InputError(f"{where}: the format of the heightmap {path} is not supported; use {known}")
    size = child_numbers(form, "size", (1.0, 1.0, 1.0), where)
    if not (size[:2] > 0).all():
        x, y = size[:2]
        raise InputError(f"{where}: the x and y <size> of a <heightmap> must be above 0, not {x:g} and {y:g}")
    grey = _grey(resources.read(path), path)
    grey = grey.max() - grey if size[2] < 0 else grey
    heights = grey * (abs(size[2]) / max(float(grey.max()), 1.0))
    middle = from_rotation(np.eye(3), child_numbers(form, "pos", (0.0, 0.0, 0.0), where))
    return _tiles(heights[::-1], size[:2], T_world @ middle)


def _grey(content: bytes, path: "Path") -> NDArray[np.float64]:
    """(rows, columns) brightness, from the first channel of a picture of 8 or 16 bits."""
    try:
        with Image.open(BytesIO(content)) as image:
            if not 4 <= image.width * image.height <= MAX_PIXELS or min(image.size) < 2:
                raise InputError(
                    f"{path}: the heightmap has {image.width} × {image.height} pixels; it must have at least 2 × 2"
                    f" and at most {MAX_PIXELS} in all"
                )
            plain = image.convert("RGB") if image.mode == "P" else image
            pixels = np.asarray(plain, np.float64)
    except InputError:
        raise
    except Exception as error:  # broken pictures raise many kinds of exceptions
        raise InputError(f"{path}: cannot be read as an image: {' '.join(str(error).split())[:200]}") from error
    return pixels if pixels.ndim == 2 else pixels[..., 0]


def _tiles(heights: NDArray[np.float64], size: NDArray[np.float64], T_world: Pose) -> list[GroundTile]:
    cells = np.array(heights.shape[::-1]) - 1  # along x and y
    step = size / cells
    ends = [_tile_ends(int(n), float(length)) for n, length in zip(cells, size, strict=True)]
    tiles = []
    for x0, x1 in zip(ends[0][:-1], ends[0][1:], strict=True):
        for y0, y1 in zip(ends[1][:-1], ends[1][1:], strict=True):
            middle = step * [(x0 + x1) / 2, (y0 + y1) / 2] - size / 2
            T = T_world @ from_rotation(np.eye(3), [*middle, 0.0])
            tiles.append(GroundTile(T, step * [x1 - x0, y1 - y0] / 2, heights[y0 : y1 + 1, x0 : x1 + 1]))
    return tiles


def _tile_ends(cells: int, length: float) -> NDArray[np.int64]:
    """Indices of the points at which tiles start and end, along an axis with ``cells`` cells and ``length`` m."""
    count = int(np.clip(round(length / TILE_SIDE), 1, min(MAX_TILES, cells)))
    return np.linspace(0, cells, count + 1).round().astype(np.int64)
