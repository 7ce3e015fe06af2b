"""2D maps, read back as other programs read them."""

import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import rasterio
from matplotlib.path import Path as Outline

from pipeline.metric_map.io.plans import save_dxf, save_geotiff, save_svg, save_world_png

GREYS = np.array([0, 205, 254], np.uint8)
CELL, ORIGIN = 0.05, np.array([-1.5, 2.25])


@pytest.fixture
def cells() -> np.ndarray:
    """(nx, ny) greys at random, so that cells touch at corners and lie in holes."""
    return GREYS[np.random.default_rng(3).integers(0, 3, (17, 12))]


def test_rasterio_reads_it(cells: np.ndarray, tmp_path: Path) -> None:
    for name, save in (("map.tif", save_geotiff), ("map.png", save_world_png)):
        save(tmp_path / name, cells, CELL, ORIGIN)
        with rasterio.open(tmp_path / name) as raster:
            np.testing.assert_array_equal(raster.read(1), cells.T[::-1])
            np.testing.assert_allclose(raster.bounds, (-1.5, 2.25, -1.5 + 17 * CELL, 2.25 + 12 * CELL), atol=1e-9)
            assert next(raster.sample([(-1.5 + 4.5 * CELL, 2.25 + 6.5 * CELL)]))[0] == cells[4, 6]


def test_a_geotiff_is_in_metres_and_unknown_ground_has_no_data(cells: np.ndarray, tmp_path: Path) -> None:
    save_geotiff(tmp_path / "map.tif", cells, CELL, ORIGIN)
    with rasterio.open(tmp_path / "map.tif") as raster:
        assert 'UNIT["metre",1,' in raster.crs.wkt
        assert raster.nodata == 205
        np.testing.assert_array_equal(raster.read(1, masked=True).mask, cells.T[::-1] == 205)


def within(edges: list, shape: tuple[int, int]) -> np.ndarray:
    """Which cells lie within outlines, by the rule of even and odd."""
    i, j = np.indices(shape).reshape(2, -1)
    middles = np.column_stack([i, j]) * CELL + CELL / 2 + ORIGIN
    inside = np.zeros(len(middles), np.bool_)
    for edge in edges:
        corners = np.array(edge, float)
        inside ^= Outline(np.vstack([corners, corners[:1]])).contains_points(middles)
    return inside.reshape(shape)


def test_outlines_hold_the_cells_and_no_others(cells: np.ndarray, tmp_path: Path) -> None:
    save_svg(tmp_path / "map.svg", cells, CELL, ORIGIN)
    root = ET.parse(tmp_path / "map.svg").getroot()
    for part, grey in (("unknown", 205), ("free", 254), ("occupied", 0)):
        (path,) = root.findall(f".//*[@id='{part}']")
        edges = [[point.split() for point in line.split("L")] for line in path.attrib["d"].strip("Mz").split("zM")]
        np.testing.assert_array_equal(within(edges, cells.shape), cells == grey)
        assert all(a != b for edge in edges for a, b in pairwise([*edge, edge[0]]))  # no point twice in a row
    low, high = ORIGIN, ORIGIN + np.array(cells.shape) * CELL
    x, y, width, height = map(float, root.attrib["viewBox"].split())
    np.testing.assert_allclose((x, -y - height, x + width, -y), (*low, *high), atol=1e-6)


def test_ezdxf_reads_it_and_finds_nothing_wrong(cells: np.ndarray, tmp_path: Path) -> None:
    save_dxf(tmp_path / "map.dxf", cells, CELL, ORIGIN)
    drawing = ezdxf.readfile(tmp_path / "map.dxf")
    assert not drawing.audit().has_issues
    for part, grey in (("unknown", 205), ("free", 254), ("occupied", 0)):
        lines = drawing.modelspace().query(f"POLYLINE[layer=='{part}']")
        assert all(line.is_closed for line in lines)
        edges = [[(point.x, point.y) for point in line.points()] for line in lines]
        np.testing.assert_array_equal(within(edges, cells.shape), cells == grey)
