"""The 2D map in the league's format, drawn with every element that the rules list."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from pipeline.arrays import Cells, Layer, MaskLayer, Place, Places, Points, Pose, Rgb
from pipeline.elevation_map.traversability import Traversability
from pipeline.grid_map import Grid, check_memory
from pipeline.lettering import IN_MIDDLE, width_of, write
from pipeline.metric_map.io.plans import write_geotiff
from pipeline.metric_map.io.ros_map import LETHAL_COST, costs
from pipeline.metric_map.metric_map import LOG_ODDS_PER_UNIT, MetricMap
from pipeline.plugins.league.pois import PointOfInterest
from pipeline.plugins.league.rules import LENGTHS, MAP_COLOURS, pixels
from pipeline.transforms import inverse, transform_points

CAPITAL_HEIGHT = 0.7  # Height of capital letters as a fraction of the font's size


@dataclass(frozen=True, eq=False)
class SearchedGround:
    """The ground that was searched.

    Attributes:
        grid: grid of the layers, in ``map``.
        walls: cells with walls and obstacles.
        confidence: probability, at least ½, that the map is right about the ground; 0 where nothing is known.
    """

    grid: Grid
    walls: MaskLayer
    confidence: Layer


def searched_ground(ground: Traversability, metric_map: MetricMap, places: Places) -> SearchedGround:
    """The ground that is connected to positions where the robot was, and the obstacles."""
    cost, grid = costs(ground, places), ground.grid
    i, j = np.nonzero(cost >= 0)
    points = np.column_stack([grid.centre_of(np.stack([i, j], axis=1)), np.nan_to_num(ground.elevation[i, j])])
    confidence = np.zeros(grid.shape)
    confidence[i, j] = expit(LOG_ODDS_PER_UNIT * np.abs(metric_map.log_odds_at(metric_map.voxel_index(points))))
    return SearchedGround(grid, cost == LETHAL_COST, confidence)


@dataclass(frozen=True, eq=False)
class LeagueMap:
    """A 2D map in the league's frame: x to the right, y up.

    Attributes:
        image: the drawing; a pixel is ``LENGTHS["pixel"]`` m wide.
        corner: upper left corner of the image, x and y, m.
    """

    image: Rgb
    corner: Place

    def pixel_of(self, points: NDArray[np.floating]) -> Cells:
        """(..., 2) columns and rows of points (..., 2 or 3), m, in the league's frame."""
        return np.floor((points[..., :2] - self.corner) * [1, -1] / LENGTHS["pixel"]).astype(np.int64)


def draw_league_map(
    title: str, ground: SearchedGround, T_map_league: Pose, path: Places, pois: Sequence[PointOfInterest]
) -> LeagueMap:
    """Draw the 2D map.

    Args:
        title: the file's name.
        ground: the ground that was searched.
        T_map_league: pose of the league's frame: level, at the robot's front at the start, with y forward.
        path: positions along the robot's path, beginning at its start.
        pois: the finds.

    Raises:
        InputError: the map is so large that the image would take too much memory.
    """
    driven = transform_points(inverse(T_map_league), path)
    searched = ground.grid.centre_of(np.argwhere(ground.confidence > 0))
    corners = transform_points(inverse(T_map_league), np.column_stack([searched, np.zeros(len(searched))]))
    league_map = _empty_map(
        np.concatenate([corners, driven, *(poi.position[None] for poi in pois)])[:, :2], len(title)
    )
    _draw_ground(league_map, ground, T_map_league)
    _draw_start(league_map, driven[0])
    # The path is drawn over the start, because it is only a dot there if the robot could not leave its start.
    line = league_map.pixel_of(driven)[:, None].astype(np.int32)
    cv2.polylines(league_map.image, [line], False, MAP_COLOURS["path"], pixels("path"))
    for poi in pois:
        if poi.type in MAP_COLOURS:
            _draw_find(league_map, poi)
    _draw_title_and_axes(league_map, title)
    return league_map


def write_league_map(
    path: Path, ground: SearchedGround, T_map_league: Pose, driven: Places, pois: Sequence[PointOfInterest]
) -> None:
    """Draw the 2D map with :func:`draw_league_map`, and write it as a GeoTIFF in the league's frame.

    Raises:
        InputError: the file cannot be written, or the image would take too much memory.
    """
    league_map = draw_league_map(path.name, ground, T_map_league, driven, pois)
    write_geotiff(path, league_map.image, LENGTHS["pixel"], league_map.corner)


def _empty_map(points: Places, letters: int) -> LeagueMap:
    """A checkerboard around points, wide enough for a title of ``letters`` letters next to the scale."""
    pixel, margin = LENGTHS["pixel"], LENGTHS["margin"]
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    high += [max(0.0, letters * LENGTHS["title"] + 2 * LENGTHS["scale"] - (high - low)[0]), margin]
    corner = np.rint([low[0] / pixel, high[1] / pixel]) * pixel
    width, height = np.ceil((high - low) / pixel).astype(int).tolist()
    check_memory(f"a 2D map of {width} × {height} pixels", 2 * 3 * width * height)
    x = np.floor((corner[0] + (np.arange(width) + 0.5) * pixel) / LENGTHS["checker"])
    y = np.floor((corner[1] - (np.arange(height) + 0.5) * pixel) / LENGTHS["checker"])
    is_dark = ((x[None] + y[:, None]) % 2).astype(np.uint8)
    return LeagueMap(np.array([MAP_COLOURS["light"], MAP_COLOURS["dark"]], np.uint8)[is_dark], corner)


def _draw_ground(league_map: LeagueMap, ground: SearchedGround, T_map_league: Pose) -> None:
    """Draw the searched area in greys that show its confidence, the grid on it, and the walls."""
    confidence, is_wall = (
        _at_pixels(league_map, layer, ground.grid, T_map_league) for layer in _grey_and_wall_layers(ground)
    )
    is_known = confidence > 0
    league_map.image[is_known] = confidence[is_known, None]
    step, first = pixels("grid"), league_map.pixel_of(np.zeros(2))
    for lines in (np.s_[first[1] % step :: step], np.s_[:, first[0] % step :: step]):
        league_map.image[lines][is_known[lines]] = MAP_COLOURS["grid"]
    league_map.image[is_wall > 0] = MAP_COLOURS["walls"]


def _grey_and_wall_layers(ground: SearchedGround) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(nx, ny) greys of the confidence, from ``searched`` to ``text``, or 0 on unknown ground; and (nx, ny) walls."""
    (least, *_), (most, *_) = MAP_COLOURS["searched"], MAP_COLOURS["text"]
    greys = np.rint(least + (2 * ground.confidence - 1) * (most - least))
    return np.where(ground.confidence > 0, greys, 0).astype(np.uint8), ground.walls.astype(np.uint8)


def _at_pixels(league_map: LeagueMap, layer: NDArray[np.uint8], grid: Grid, T_map_league: Pose) -> NDArray[np.uint8]:
    """(H, W) values of a layer (nx, ny) at the pixels of a league map; 0 outside the layer's grid in ``map``."""
    pixel, flat = LENGTHS["pixel"], np.delete(np.delete(T_map_league, 2, 0), 2, 1)
    x, y = league_map.corner + np.array([pixel, -pixel]) / 2
    of_pixels = np.array([[pixel, 0, x], [0, -pixel, y], [0, 0, 1]])
    to_cells = np.array([[1, 0, -grid.origin[0]], [0, 1, -grid.origin[1]], [0, 0, grid.cell]]) / grid.cell
    M = (to_cells @ flat @ of_pixels)[:2]
    M[:, 2] -= 0.5  # OpenCV's pixel centres are at integers
    flags: Any = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    size = league_map.image.shape[1::-1]
    return cv2.warpAffine(np.ascontiguousarray(layer.T), M, size, flags=flags).astype(np.uint8)


def _draw_start(league_map: LeagueMap, start: Points) -> None:
    """Draw an arrow that points up, centred on the robot's start position."""
    x, y = league_map.pixel_of(start).tolist()
    half = pixels("arrow", 0.5)
    side = half // 2
    tips = np.array([(0, -half), (-side, half), (0, side), (side, half)], np.int32)
    cv2.fillPoly(league_map.image, [tips + np.array([x, y], np.int32)], MAP_COLOURS["start"])


def _draw_find(league_map: LeagueMap, poi: PointOfInterest) -> None:
    """Draw a tag as a disc with its number, or another find as a diamond with the first two letters of its name."""
    x, y = league_map.pixel_of(poi.position).tolist()
    if poi.type == "ar_code":
        radius, text = pixels("disc", 0.5), poi.name
        cv2.circle(league_map.image, (x, y), radius, MAP_COLOURS[poi.type], cv2.FILLED)
    else:
        radius, text = pixels("diamond", 0.5), poi.name[:2]
        tips = np.array([(x, y - radius), (x + radius, y), (x, y + radius), (x - radius, y)], np.int32)
        cv2.fillPoly(league_map.image, [tips], MAP_COLOURS[poi.type])
    size = radius * min(1 / CAPITAL_HEIGHT, radius / max(1, width_of(text, radius)))
    write(league_map.image, (x, y), text, size, MAP_COLOURS["text"], IN_MIDDLE, is_smooth=False)


def _draw_title_and_axes(league_map: LeagueMap, title: str) -> None:
    """Draw the file's name at the top left, and the scale and the axes at the top right.

    As the rules require, the axes are drawn with x up and y left, although y points up in the league's frame.
    """
    letter, right, axis = pixels("title"), league_map.image.shape[1] - pixels("margin", 0.5), pixels("axis")
    _write_text(league_map, (letter, 2 * letter), title, letter, "file_name")
    first = right - pixels("scale")
    league_map.image[2 * letter : 2 * letter + 2, first:right] = MAP_COLOURS["scale"]
    _write_text(league_map, (first, 2 * letter - 3), "1 m", letter / 2, "scale")
    foot = (right, 3 * letter + axis)
    for name, tip in (("x", (right, foot[1] - axis)), ("y", (right - axis, foot[1]))):
        cv2.arrowedLine(league_map.image, foot, tip, MAP_COLOURS["scale"], 2)
        _write_text(league_map, (tip[0] + 3, tip[1] - 8), name, letter / 2, "scale")


def _write_text(league_map: LeagueMap, at: tuple[int, int], text: str, height: float, element: str) -> None:
    """Write a text with capitals ``height`` pixels high, in exactly the colour that the rules give to the element."""
    write(league_map.image, at, text, height / CAPITAL_HEIGHT, MAP_COLOURS[element], is_smooth=False)
