"""A 2D map for geographic information systems and drawing programs: GeoTIFF, PNG with a world file, SVG, DXF."""

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin, TiffTags

from pipeline.arrays import MaskLayer, Place, Places
from pipeline.files import atomic_write
from pipeline.metric_map.io.exports import PGM_FREE, PGM_OCCUPIED, PGM_UNKNOWN

Greys = NDArray[np.uint8]
GEO_KEYS = (1, 1, 0, 3, 1024, 0, 1, 32767, 1025, 0, 1, 1, 3076, 0, 1, 9001)
"""GeoTIFF 1.1 key directory: version 1.1.0 and three keys: user-defined model (``map``), pixels as areas, metres."""


class GeoTag(IntEnum):
    """TIFF tags that georeference an image (OGC GeoTIFF 1.1), and GDAL's tag for the value of unknown pixels."""

    PIXEL_SCALE = 33550
    TIEPOINT = 33922
    KEYS = 34735
    NO_DATA = 42113


LOOKS = {"unknown": (PGM_UNKNOWN, "#cdcdcd"), "free": (PGM_FREE, "#ffffff"), "occupied": (PGM_OCCUPIED, "#1a1a1a")}
"""Grey value and colour of each kind of ground."""


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
    """Write cells as PNG, and their size and position as world file (.pgw); arguments as in :func:`save_geotiff`."""
    x, y = origin[0] + cell / 2, origin[1] + (cells.shape[1] - 0.5) * cell
    with atomic_write(path) as partial:
        partial.write_bytes(cv2.imencode(".png", _image(cells))[1].tobytes())
    place = path.with_suffix(".pgw")
    with atomic_write(place) as partial:
        partial.write_text("".join(f"{value:.9g}\n" for value in (cell, 0, 0, -cell, x, y)))
    return [path, place]


def save_svg(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write the outlines of cells as SVG, in m, with y up; arguments as in :func:`save_geotiff`."""
    width, height = np.array(cells.shape) * cell
    x, y = origin
    parts = []
    for name, (grey, colour) in LOOKS.items():
        edges = _outlines(cells == grey, cell, origin)
        drawn = "".join("M" + "L".join(f"{x:.6g} {y:.6g}" for x, y in edge) + "z" for edge in edges)
        parts.append(f'<path id="{name}" fill="{colour}" d="{drawn}"/>\n')
    with atomic_write(path) as partial:
        partial.write_text(
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{100 * width:.6g}" height="{100 * height:.6g}"'
            f' viewBox="{x:.6g} {-y - height:.6g} {width:.6g} {height:.6g}">\n'
            f'<g transform="scale(1 -1)" fill-rule="evenodd">\n{"".join(parts)}</g>\n</svg>\n'
        )
    return [path]


def save_dxf(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells as closed polylines, m, one layer per kind of ground; arguments as in :func:`save_geotiff`.

    The format is DXF release 12 (AC1009), which requires only the section ENTITIES: pairs of group code and value.
    """
    pairs: list[tuple[int, object]] = [(0, "SECTION"), (2, "ENTITIES")]
    for name, (grey, _) in LOOKS.items():
        for edge in _outlines(cells == grey, cell, origin):
            pairs += [(0, "POLYLINE"), (8, name), (66, 1), (70, 1)]
            for x, y in edge:
                pairs += [(0, "VERTEX"), (8, name), (10, f"{x:.6g}"), (20, f"{y:.6g}"), (30, 0.0)]
            pairs += [(0, "SEQEND"), (8, name)]
    with atomic_write(path) as partial:
        partial.write_text("".join(f"{code}\n{value}\n" for code, value in [*pairs, (0, "ENDSEC"), (0, "EOF")]))
    return [path]


def _image(cells: Greys) -> Greys:
    """Grey values (nx, ny) as an image (ny, nx) whose first row has the greatest y."""
    return np.ascontiguousarray(cells.T[::-1])


def _outlines(mask: MaskLayer, cell: float, origin: Place) -> list[Places]:
    """The closed outlines of a mask (nx, ny), each (N, 2) m; holes have outlines too."""
    # OpenCV's contours run through pixel centres; with 3 × 3 pixels per cell, each centre has one nearest cell edge.
    fine = np.ascontiguousarray(np.kron(mask.T, np.ones((3, 3), np.uint8)), np.uint8)
    contours, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    edges = [np.rint((contour[:, 0] + 0.5) / 3) for contour in contours]
    # Contours cut corners, so two consecutive points may round to the same corner.
    return [edge[(edge != np.roll(edge, 1, axis=0)).any(axis=1)] * cell + origin for edge in edges]


SAVED: dict[str, Callable[[Path, Greys, float, Place], list[Path]]] = {
    ".tif": save_geotiff,
    ".png": save_world_png,
    ".svg": save_svg,
    ".dxf": save_dxf,
}
"""The function that writes files with each suffix."""
