"""Properties of the ground that rescuers need to know: slopes, drops, low ceilings, and unseen areas."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Layer, MaskLayer, Place, Points, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.grid_map import Grid
from pipeline.labels import RAMP_TILT
from pipeline.rescue_report.config import RescueReportConfig

EDGE_WINDOW = 5
"""Side of the window in which the ground in front of an edge is sought, cells; edges are at most half as wide."""
MIN_WALL_DISTANCE = 0.15
"""Distance from walls and steps below which no ground is expected, m."""


@dataclass(frozen=True, eq=False)
class ReportedPlace:
    """A group of neighbouring cells.

    Attributes:
        position: centre of the cell nearest to the mean of all the cells, m.
        area: area of the cells, m².
        value: maximum of the cells' values.
    """

    position: Place
    area: float
    value: float


def places(grid: Grid, mask: MaskLayer, values: NDArray, apart: float) -> list[ReportedPlace]:
    """The places formed by the cells of a mask, sorted by value, the greatest first.

    Args:
        grid: grid of the cells.
        mask: cells that form the places.
        values: (nx, ny) value of every cell.
        apart: distance below which cells belong to the same place, m; adjacent cells always belong to one place.
    """
    reach = 1 + 2 * round(apart / grid.cell / 2)
    pieces, _ = ndimage.label(ndimage.maximum_filter(mask, reach), np.ones((3, 3)))
    pieces[~mask] = 0
    found = []
    for piece, box in enumerate(ndimage.find_objects(pieces), start=1):
        if box is None:
            continue
        cells = np.argwhere(pieces[box] == piece)
        middle = cells[np.linalg.norm(cells - cells.mean(axis=0), axis=1).argmin()]
        corner = [side.start for side in box]
        value = float(values[box][pieces[box] == piece].max())
        found.append(ReportedPlace(grid.centre_of(middle + corner), len(cells) * grid.cell**2, value))
    return sorted(found, key=lambda place: -place.value)


@dataclass(frozen=True, eq=False)
class Hazards:
    """Hazards on the ground that the robot can reach; the layers are on the traversability's grid.

    Attributes:
        slope: inclination of the ground, rad.
        is_steep: cells that are part of a slope.
        drop: height by which the ground falls at a cell, m; 0 for cells without a drop.
        slopes: slopes, the steepest first, with their maximum inclination, rad.
        drops: drops, the deepest first, with their depth, m.
        ceilings: low ceilings, the lowest first, with their headroom, m.
    """

    slope: Layer
    is_steep: MaskLayer
    drop: Layer
    slopes: list[ReportedPlace]
    drops: list[ReportedPlace]
    ceilings: list[ReportedPlace]


def find_hazards(
    traversability: Traversability, reachable: MaskLayer, points: Points, config: RescueReportConfig
) -> Hazards:
    """The hazards on the ground that the robot can reach.

    Drops that are closer together than the robot's width form one place; the same holds for low ceilings.

    Args:
        traversability: traversability of the robot's map. Drops are reported within the robot's length of reachable
            ground, unless the robot can roll over them. Points below the robot's headroom are obstacles, not
            ceilings.
        reachable: cells that the robot can reach.
        points: points of the semantic map.
        config: limits from which hazards are reported.
    """
    grid = traversability.grid
    robot = traversability.robot
    # Slopes: opening removes single noisy cells.
    slope = np.arctan(np.linalg.norm(traversability.gradient.astype(np.float64), axis=-1))
    is_steep = ndimage.binary_opening((slope > RAMP_TILT) & ~traversability.hazard, np.ones((3, 3))) & reachable
    drop = _drops(traversability, reachable, config.drop)
    # Ceilings: the lowest point above each cell, among the points that the robot does not touch.
    headroom = np.full(grid.shape, np.inf)
    above = points[:, 2] - grid.at(traversability.elevation, points, outside=np.nan)
    hangs = above >= robot.headroom
    np.minimum.at(headroom, tuple(grid.cell_of(points[hangs]).T), above[hangs])
    lowest_first = places(grid, reachable & (headroom < config.upright_headroom), -headroom, robot.width)
    return Hazards(
        slope=slope,
        is_steep=is_steep,
        drop=drop,
        slopes=places(grid, is_steep, slope, 0),
        drops=places(grid, drop > 0, drop, robot.width),
        ceilings=[ReportedPlace(place.position, place.area, -place.value) for place in lowest_first],
    )


def _drops(traversability: Traversability, reachable: MaskLayer, min_drop: float) -> Layer:
    """Height by which the ground falls at the edges of the reachable ground, m; 0 elsewhere."""
    grid = traversability.grid
    robot = traversability.robot
    elevation = traversability.elevation.astype(np.float64)
    # Edges border on the ground from which they are reached. Steps are not traversable, so the ground above a step
    # and the ground below it are in different pieces.
    pieces, _ = ndimage.label(~traversability.hazard & ~np.isnan(elevation))
    connected = np.isin(pieces, np.unique(pieces[reachable]))
    highest = ndimage.maximum_filter(np.where(connected, elevation, -np.inf), EDGE_WINDOW)
    is_edge = traversability.hazard & (np.abs(elevation - highest) < min_drop)
    is_edge &= grid.distance_to(reachable) <= robot.length
    # No wheel reaches the bottom of a gap that the robot can roll over, so a greyscale closing that ignores NaN fills
    # such gaps.
    slit = 1 + 2 * int(robot.max_gap / 2 / grid.cell)
    raised = ndimage.maximum_filter(np.nan_to_num(elevation, nan=-np.inf), slit)
    closed = ndimage.minimum_filter(np.where(np.isneginf(raised), np.inf, raised), slit)
    ground = np.where(np.isnan(elevation), np.nan, closed)
    drop = np.zeros(grid.shape)
    edges = np.argwhere(is_edge)
    drop[is_edge] = elevation[is_edge] - _lowest_beyond(grid, elevation, ground, edges, robot.length, min_drop)
    # Edges shorter than half the robot's width are seams between the arena's parts.
    pieces, _ = ndimage.label(drop >= min_drop, np.ones((3, 3)))
    is_long = np.bincount(pieces.ravel())[pieces] >= round(robot.half_width / grid.cell)
    return np.where((drop >= min_drop) & is_long, drop, 0.0)


def _lowest_beyond(
    grid: Grid, elevation: Layer, ground: Layer, edges: Cells, reach: float, min_drop: float
) -> Values:
    """(N,) m, height of the lowest ground within ``reach`` m beyond each of the N edges.

    The search extends over the robot's length, because the camera often misses the nearest ground. In each direction,
    the search ends at the first cell whose height exceeds the edge's height minus ``min_drop`` m. Such a cell is
    level ground or a wall, behind which the robot cannot fall.
    """
    height = elevation[tuple(edges.T)][:, None]
    middles = grid.centre_of(edges)[:, None]
    count = ceil(2 * np.pi * reach / grid.cell)  # one bearing for each cell on the circle
    bearings = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ahead = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    is_open = np.ones((len(edges), count), np.bool_)
    lowest = np.broadcast_to(height, is_open.shape)
    for distance in np.arange(grid.cell / 2, reach, grid.cell / 2):
        there = middles + distance * ahead
        has_left = (grid.cell_of(there) != edges[:, None]).any(axis=-1)
        is_open &= ~(has_left & (grid.at(elevation, there, outside=np.nan) > height - min_drop))
        lowest = np.fmin(lowest, np.where(is_open, grid.at(ground, there, outside=np.nan), np.nan))
    return lowest.min(axis=1)


@dataclass(frozen=True, eq=False)
class Unseen:
    """Ground that was not seen.

    Attributes:
        places: places of unseen ground large enough for a person, the largest first.
        small_patch_area: total area of the smaller unseen patches, m².
        seen_area: area of the ground that was seen, m². If any ground is reachable, only the ground connected to
            reachable ground is included.
        is_reachable: whether the robot can reach any ground; if not, :attr:`seen_area` includes all ground that was
            seen.
    """

    places: list[ReportedPlace]
    small_patch_area: float
    seen_area: float
    is_reachable: bool

    @property
    def area(self) -> float:
        """Area of the unseen ground, m²."""
        return self.small_patch_area + sum(place.area for place in self.places)

    @property
    def seen_fraction(self) -> float | None:
        """Ratio of the seen area to the total of the seen and unseen areas; None if no ground is reachable."""
        whole = self.seen_area + self.area
        return self.seen_area / whole if self.is_reachable and whole else None


def find_unseen(
    traversability: Traversability, measured: Layer, reachable: MaskLayer, config: RescueReportConfig
) -> Unseen:
    """The ground that was not seen: inside the map's outline, and beyond the reachable ground.

    Args:
        traversability: traversability of the robot's map. Ground within the robot's length of reachable ground is
            treated as connected to the reachable ground.
        measured: height of the ground as measured by returns, m; NaN elsewhere.
        reachable: cells that the robot can reach.
        config: limits for ground that is expected and for places that are reported.
    """
    grid = traversability.grid
    unknown = np.isnan(measured)
    outline = ndimage.binary_fill_holes(~np.isnan(traversability.elevation))
    is_clear = traversability.to_hazard >= MIN_WALL_DISTANCE
    # A partly seen wall has gaps; ground is expected to extend only through wide gaps.
    steps = round(config.expected_extent / grid.cell)
    # With 0 iterations, SciPy dilates until nothing changes.
    ahead = ndimage.binary_dilation(reachable, iterations=steps, mask=is_clear) if steps else reachable
    cells = unknown & (outline | ahead) & is_clear
    found = sorted(places(grid, cells, cells, 0), key=lambda place: -place.area)
    is_reachable = bool(reachable.any())
    joins = grid.distance_to(reachable) <= traversability.robot.length if is_reachable else np.True_
    return Unseen(
        places=[place for place in found if place.area >= config.person_area],
        small_patch_area=sum(place.area for place in found if place.area < config.person_area),
        seen_area=float(np.count_nonzero(joins & ~unknown & ~traversability.hazard)) * grid.cell**2,
        is_reachable=is_reachable,
    )
