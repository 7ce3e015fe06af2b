"""2D maps of the ground, read as Nav2 reads them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy import ndimage

from pipeline.elevation_map.traversability import assess_map
from pipeline.metric_map.io.ros_map import save_ros_map
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ramp_and_deck, ridge, surface_of, wall_points

RADIUS = 0.25
"""m, radius of the robot in Nav2, by which it inflates lethal cells."""


class NavMap:
    """A map as Nav2's map_server reads it from a .yaml (nav2_map_server, map_io.cpp, loadMapFromFile)."""

    def __init__(self, path: Path) -> None:
        about = yaml.safe_load(path.read_text())
        image = cv2.imread(str(path.parent / about["image"]), cv2.IMREAD_UNCHANGED).astype(float)
        grey, opaque = (image[..., :3].mean(-1), image[..., 3] == 255) if image.ndim == 3 else (image, image >= 0)
        assert about["negate"] == 0
        dark = 1 - grey / 255
        free, occupied = about["free_thresh"], about["occupied_thresh"]
        between = {"trinary": -1, "scale": np.rint((dark - free) / (occupied - free) * 100)}[about["mode"]]
        cells = np.select([dark > occupied, dark < free], [100, 0], between)
        if about["mode"] == "scale":
            cells[~opaque] = -1
        self.cells, self.resolution, self.origin = cells[::-1].T, about["resolution"], about["origin"]

    def at(self, x: float, y: float) -> float:
        i, j = ((np.array([x, y]) - self.origin[:2]) / self.resolution).astype(int)
        return self.cells[i, j] if i < self.cells.shape[0] else -1

    def ways(self) -> np.ndarray:
        """(nx, ny) number of the connected area in which a robot of RADIUS can drive; 0 where it cannot stand."""
        room = ndimage.distance_transform_edt(self.cells != 100) * self.resolution
        return ndimage.label((room > RADIUS) & (self.cells >= 0))[0]

    def joins(self, a: tuple[float, float], b: tuple[float, float]) -> bool:
        cells = [((np.array(p) - self.origin[:2]) / self.resolution).astype(int) for p in (a, b)]
        first, second = (self.ways()[tuple(cell)] for cell in cells)
        return bool(first) and first == second


@pytest.fixture(scope="module")
def deck(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ramp up to a deck, floor on both sides, and a wall at x = 3 with floor behind it."""
    ground = ground_points(ramp_and_deck, (-1.5, 2.0), (-1.5, 1.5))
    behind = ground_points(flat, (3.1, 4), (-1, 1))
    world = surface_of(ground, ground_points(flat, (2.0, 3.0), (-1.5, 1.5)), wall_points((3, -1.5), (3, 1.5)), behind)
    path = tmp_path_factory.mktemp("map") / "map.pgm"
    save_ros_map(path, assess_map(world), [(-1, 0)])
    return path


def test_a_deck_is_reached_over_its_ramp_and_not_over_its_edge(deck: Path) -> None:
    nav = NavMap(deck.with_suffix(".yaml"))
    assert nav.at(-1, 0) == nav.at(0.3, 0) == nav.at(1.2, 0) == 0
    assert nav.joins((-1, 0), (1.2, 0))
    assert max(nav.at(1.2, 0.57), nav.at(1.2, 0.62)) == 100
    nav.cells[np.s_[: int((0.4 - nav.origin[0]) / nav.resolution)]] = 100  # without the ramp there is no way up
    assert not nav.joins((1.2, 0), (1.2, 1.2))


def test_walls_are_lethal_and_what_nothing_joins_is_unknown(deck: Path) -> None:
    nav = NavMap(deck.with_suffix(".yaml"))
    assert nav.at(3.02, 0) == 100
    assert nav.at(3.5, 0) == -1  # never been there: seen over the wall


def test_slopes_are_costs(deck: Path) -> None:
    nav, trinary = NavMap(deck.with_name("map_cost.yaml")), NavMap(deck.with_suffix(".yaml"))
    slope = np.degrees(np.arctan(RISE / RUN))
    assert nav.at(0.3, 0) == pytest.approx(98 * slope / 20, abs=2)
    assert nav.at(-1, 0) == nav.at(1.2, 0) == 0
    np.testing.assert_array_equal(nav.cells == 100, trinary.cells == 100)
    np.testing.assert_array_equal(nav.cells == -1, trinary.cells == -1)


def test_a_ridge_of_ramps_is_driven_over(tmp_path: Path) -> None:
    world = surface_of(ground_points(ridge, (-1.5, 1.5), (-0.6, 0.6)))
    save_ros_map(tmp_path / "map.pgm", assess_map(world), [(-1, 0)])
    assert NavMap(tmp_path / "map.yaml").joins((-1, 0), (1, 0))


def test_a_map_of_nothing_is_unknown(tmp_path: Path) -> None:
    save_ros_map(tmp_path / "map.pgm", assess_map(surface_of(ground_points(flat, (0, 1), (0, 1)))), [(9, 9)])
    assert NavMap(tmp_path / "map.yaml").cells.tolist() == [[-1]]
