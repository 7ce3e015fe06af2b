"""A 2D map for geographic information systems: GeoTIFF, or PNG with a world file."""

from enum import IntEnum
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin, TiffTags

from pipeline.arrays import Place
from pipeline.files import atomic_write
from pipeline.metric_map.io.exports import PGM_UNKNOWN

Greys = NDArray[np.uint8]
GEO_KEYS = (1, 1, 0, 3, 1024, 0, 1, 32767, 1025, 0, 1, 1, 3076, 0, 1, 9001)
"""GeoTIFF 1.1 key directory: version 1.1.0 and three keys: user-defined model (``map``), pixels as areas, metres."""


class GeoTag(IntEnum):
    """TIFF tags that georeference an image (OGC GeoTIFF 1.1), and GDAL's tag for the value of unknown pixels."""

    PIXEL_SCALE = 33550
    TIEPOINT = 33922
    KEYS = 34735
    NO_DATA = 42113


def save_geotiff(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells (nx, ny) of side ``cell``, m, as lossless GeoTIFF; ``origin``: (2,) corner of the first cell, m.

    Returns:
        The files that were written.

    Raises:
        InputError: the file cannot be written.
    """
    top = origin + np.array([0.0, cells.shape[1] * cell])
    write_geotiff(path, _image(cells), cell, top, PGM_UNKNOWN)
    return [path]


def write_geotiff(path: Path, image: Greys, pixel: float, corner: Place, unknown: int | None = None) -> None:
    """Write an image, with y pointing up, as lossless GeoTIFF.

    Args:
        path: the ``.tif`` file.
        image: (H, W) grey or (H, W, 3) RGB.
        pixel: side of a pixel, m.
        corner: (2,) upper left corner of the image, m.
        unknown: value of unknown pixels; None if there are none.

    Raises:
        InputError: the file cannot be written.
    """
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    for tag, kind, value in (
        (GeoTag.PIXEL_SCALE, TiffTags.DOUBLE, (pixel, pixel, 0.0)),
        (GeoTag.TIEPOINT, TiffTags.DOUBLE, (0.0, 0.0, 0.0, float(corner[0]), float(corner[1]), 0.0)),
        (GeoTag.KEYS, TiffTags.SHORT, GEO_KEYS),
        *([] if unknown is None else [(GeoTag.NO_DATA, TiffTags.ASCII, str(unknown))]),
    ):
        tags.tagtype[tag], tags[tag] = kind, value
    with atomic_write(path) as partial:
        Image.fromarray(image).save(partial, "TIFF", tiffinfo=tags, compression="tiff_adobe_deflate")


def save_world_png(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells as PNG, and their size and position in a world file (.pgw), as :func:`save_geotiff` does."""
    x, y = origin[0] + cell / 2, origin[1] + (cells.shape[1] - 0.5) * cell
    with atomic_write(path) as partial:
        partial.write_bytes(cv2.imencode(".png", _image(cells))[1].tobytes())
    place = path.with_suffix(".pgw")
    with atomic_write(place) as partial:
        partial.write_text("".join(f"{value:.9g}\n" for value in (cell, 0, 0, -cell, x, y)))
    return [path, place]


def _image(cells: Greys) -> Greys:
    """Grey values (nx, ny) as an image (ny, nx) whose first row has the greatest y."""
    return np.ascontiguousarray(cells.T[::-1])
