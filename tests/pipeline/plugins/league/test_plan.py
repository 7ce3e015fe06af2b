import numpy as np
import pytest
import rasterio

from pipeline.plugins.league.plan import draw_league_map
from pipeline.plugins.league.rules import MAP_COLOURS
from tests.pipeline.plugins.league.handed_in_room import PATH, T_MAP_LEAGUE, hand_in_room, room_ground, room_pois


@pytest.fixture(scope="module")
def league_map():
    return draw_league_map("RoboCup2026-T-lab.tiff", room_ground(), T_MAP_LEAGUE, PATH, room_pois())


def colour(league_map, x, y):
    """The colour at x forward and y left of the robot's middle at its start, m."""
    column, row = league_map.pixel_of(np.array([-y, x - 0.25]))
    return tuple(league_map.image[row, column].tolist())


def test_ground_and_walls(league_map):
    assert colour(league_map, 1.3, 0.6) == (192, 192, 192)  # searched with ¾
    assert colour(league_map, 0.245, 0.8) == MAP_COLOURS["grid"]
    assert colour(league_map, 2.03, 0.2) == MAP_COLOURS["walls"]
    greys = {colour(league_map, x, -2.4) for x in np.arange(-1.7, 2, 0.5)}
    assert greys == {MAP_COLOURS["light"], MAP_COLOURS["dark"]}


def test_grid_lines_are_a_pixel_wide_and_half_a_metre_apart(league_map):
    row = league_map.pixel_of(np.array([0.0, -0.87]))[1]
    is_line = (league_map.image[row] == MAP_COLOURS["grid"]).all(axis=-1)
    np.testing.assert_array_equal(np.diff(np.flatnonzero(is_line)), 50)


def test_finds_start_and_path(league_map):
    assert colour(league_map, 1.0, 1.16) == colour(league_map, 0.84, 1.0) == MAP_COLOURS["ar_code"]  # a disc of 35 cm
    assert colour(league_map, -1.0, 1.13) == MAP_COLOURS["hazmat_sign"]
    assert colour(league_map, -0.9, 1.09) != MAP_COLOURS["hazmat_sign"]  # a diamond of 30 cm
    assert colour(league_map, 1.0, -1.13) == MAP_COLOURS["real_object"]
    assert colour(league_map, 0.6, 0.0) == MAP_COLOURS["path"]
    assert colour(league_map, 0.1, 0.02) == colour(league_map, -0.2, 0.11) == MAP_COLOURS["start"]
    assert colour(league_map, 0.2, 0.11) != MAP_COLOURS["start"]  # it points up
    white = (league_map.image == MAP_COLOURS["text"]).all(axis=-1)
    column, row = league_map.pixel_of(np.array([-1.0, 0.75]))
    assert white[row - 17 : row + 18, column - 17 : column + 18].any()


def test_the_scale_is_a_metre_at_the_top_right(league_map):
    height, width = league_map.image.shape[:2]
    corner = (league_map.image[: height // 4, width // 2 :] == MAP_COLOURS["scale"]).all(axis=-1)
    assert 100 in corner.sum(axis=1)
    title = (league_map.image == MAP_COLOURS["file_name"]).all(axis=-1)
    assert np.argwhere(title).max(axis=0).tolist() < [height // 4, width]


def test_it_lies_where_the_cloud_does(tmp_path):
    path = hand_in_room(tmp_path)[0]
    with rasterio.open(path) as read:
        assert (read.transform.a, read.transform.e, read.count) == (0.01, -0.01, 3)
        row, column = read.index(-1.0, 0.75 + 0.16)
        assert tuple(band[row, column] for band in read.read()) == MAP_COLOURS["ar_code"]
