"""2D maps, read back as other programs read them."""

from pathlib import Path

import numpy as np
import pytest
import rasterio

from pipeline.metric_map.io.plans import save_geotiff, save_world_png

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
