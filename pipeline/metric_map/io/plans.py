"""A 2D map for geographic information systems and drawing programs: GeoTIFF, PNG with a world file, SVG, DXF."""

from collections.abc import Callable
from enum import IntEnum
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin, TiffTags

from pipeline.arrays import MaskLayer, Place, Places
from pipeline.files import whole_file
from pipeline.metric_map.io.exports import PGM_FREE, PGM_OCCUPIED, PGM_UNKNOWN

Greys = NDArray[np.uint8]
GEO_KEYS = (1, 1, 0, 3, 1024, 0, 1, 32767, 1025, 0, 1, 1, 3076, 0, 1, 9001)
"""Keys of GeoTIFF 1.1: version 1.1.0, three keys: a user-defined model (``map``), pixels that are areas, metres."""


class GeoTag(IntEnum):
    """Tags of a TIFF that say where it lies (OGC GeoTIFF 1.1), and GDAL's own."""

    PIXEL_SCALE = 33550
    TIEPOINT = 33922
    KEYS = 34735
    NO_DATA = 42113


LOOKS = {"unknown": (PGM_UNKNOWN, "#cdcdcd"), "free": (PGM_FREE, "#ffffff"), "occupied": (PGM_OCCUPIED, "#1a1a1a")}
"""Grey value and colour of each kind of ground."""


def save_geotiff(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells (nx, ny) of side ``cell`` m, the first one's corner at ``origin`` (2,) m, as GeoTIFF, without loss.

    Returns:
        The files that were written.

    Raises:
        InputError: the file cannot be written.
    """
    top = origin + np.array([0.0, cells.shape[1] * cell])
    write_geotiff(path, _image(cells), cell, top, PGM_UNKNOWN)
    return [path]


def write_geotiff(path: Path, image: Greys, pixel: float, corner: Place, unknown: int | None = None) -> None:
    """Write an image (H, W) or (H, W, 3), its upper left corner at ``corner`` (2,) m, y up, as GeoTIFF without loss.

    Args:
        path: of the file.
        image: grey or RGB.
        pixel: side of a pixel, m.
        corner: of the first pixel, m.
        unknown: value of unknown pixels.

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
    with whole_file(path) as partial:
        Image.fromarray(image).save(partial, "TIFF", tiffinfo=tags, compression="tiff_adobe_deflate")


def save_world_png(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells (nx, ny) as PNG, and their size and place, m, as a world file (.pgw); as :func:`save_geotiff`."""
    x, y = origin[0] + cell / 2, origin[1] + (cells.shape[1] - 0.5) * cell
    with whole_file(path) as partial:
        partial.write_bytes(cv2.imencode(".png", _image(cells))[1].tobytes())
    place = path.with_suffix(".pgw")
    with whole_file(place) as partial:
        partial.write_text("".join(f"{value:.9g}\n" for value in (cell, 0, 0, -cell, x, y)))
    return [path, place]


def save_svg(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write the outlines of cells (nx, ny) as SVG, in m, with y up; arguments as :func:`save_geotiff`."""
    width, height = np.array(cells.shape) * cell
    x, y = origin
    parts = []
    for name, (grey, colour) in LOOKS.items():
        edges = _outlines(cells == grey, cell, origin)
        drawn = "".join("M" + "L".join(f"{x:.6g} {y:.6g}" for x, y in edge) + "z" for edge in edges)
        parts.append(f'<path id="{name}" fill="{colour}" d="{drawn}"/>\n')
    with whole_file(path) as partial:
        partial.write_text(
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{100 * width:.6g}" height="{100 * height:.6g}"'
            f' viewBox="{x:.6g} {-y - height:.6g} {width:.6g} {height:.6g}">\n'
            f'<g transform="scale(1 -1)" fill-rule="evenodd">\n{"".join(parts)}</g>\n</svg>\n'
        )
    return [path]


def save_dxf(path: Path, cells: Greys, cell: float, origin: Place) -> list[Path]:
    """Write cells (nx, ny) as closed polylines, m, one layer per kind of ground; arguments as :func:`save_geotiff`.

    The DXF is of release 12 (AC1009), which requires no section but ENTITIES: pairs of code and value.
    """
    pairs: list[tuple[int, object]] = [(0, "SECTION"), (2, "ENTITIES")]
    for name, (grey, _) in LOOKS.items():
        for edge in _outlines(cells == grey, cell, origin):
            pairs += [(0, "POLYLINE"), (8, name), (66, 1), (70, 1)]
            for x, y in edge:
                pairs += [(0, "VERTEX"), (8, name), (10, f"{x:.6g}"), (20, f"{y:.6g}"), (30, 0.0)]
            pairs += [(0, "SEQEND"), (8, name)]
    with whole_file(path) as partial:
        partial.write_text("".join(f"{code}\n{value}\n" for code, value in [*pairs, (0, "ENDSEC"), (0, "EOF")]))
    return [path]


def _image(cells: Greys) -> Greys:
    """Greys (nx, ny) as an image (ny, nx) whose first row has the greatest y."""
    return np.ascontiguousarray(cells.T[::-1])


def _outlines(mask: MaskLayer, cell: float, origin: Place) -> list[Places]:
    """The closed outlines of a mask's cells (nx, ny), (N, 2) m each; holes have outlines too."""
    # OpenCV's contours run through pixel centres: with 3 × 3 pixels a cell, each centre is nearest to one edge only.
    fine = np.ascontiguousarray(np.kron(mask.T, np.ones((3, 3), np.uint8)), np.uint8)
    contours, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    edges = [np.rint((contour[:, 0] + 0.5) / 3) for contour in contours]
    # A contour cuts corners, so that two of its points lie nearest to one.
    return [edge[(edge != np.roll(edge, 1, axis=0)).any(axis=1)] * cell + origin for edge in edges]


SAVED: dict[str, Callable[[Path, Greys, float, Place], list[Path]]] = {
    ".tif": save_geotiff,
    ".png": save_world_png,
    ".svg": save_svg,
    ".dxf": save_dxf,
}
"""The function that writes each file ending."""
