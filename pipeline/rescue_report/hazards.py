"""Hazards on the reachable ground: slopes, drops and low ceilings."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy import ndimage

from pipeline.arrays import Cells, Layer, MaskLayer, Points, Values
from pipeline.elevation_map.traversability import Traversability
from pipeline.grid_map import Grid
from pipeline.labels import RAMP_TILT
from pipeline.rescue_report.config import HazardConfig
from pipeline.rescue_report.places import ReportedPlace, places
from pipeline.robot import RobotModel


@dataclass(frozen=True, eq=False)
class Hazards:
    """Hazards on the ground that the robot can reach; layers are on the grid of the traversability.

    Attributes:
        slope: inclination of the ground, rad.
        is_steep: cells that are part of a slope.
        drop: height by which the ground falls at a cell, m; 0 where it does not.
        slopes: slopes, the steepest first, with their inclination, rad.
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
    traversability: Traversability, reachable: MaskLayer, points: Points, robot: RobotModel, config: HazardConfig
) -> Hazards:
    """The hazards on the ground that the robot can reach.

    Args:
        traversability: traversability of the robot's map.
        reachable: cells that the robot can reach.
        points: points of the semantic map.
        robot: the robot. Drops count within its length of reachable ground unless it can roll over them. Points below
            its headroom are obstacles, not ceilings. Hazards closer together than its width are one place.
        config: what counts as a hazard.
    """
    grid = traversability.grid
    slope = np.arctan(np.linalg.norm(traversability.gradient.astype(np.float64), axis=-1))
    # Opening removes single noisy cells.
    is_steep = ndimage.binary_opening((slope > RAMP_TILT) & ~traversability.hazard, np.ones((3, 3))) & reachable
    drop = _drops(traversability, reachable, robot, config)
    headroom = _headroom(traversability, points, robot.headroom)
    low = reachable & (headroom < config.upright)
    lowest_first = places(grid, low, -headroom, robot.width)
    return Hazards(
        slope=slope,
        is_steep=is_steep,
        drop=drop,
        slopes=places(grid, is_steep, slope, 0),
        drops=places(grid, drop > 0, drop, robot.width),
        ceilings=[ReportedPlace(place.position, place.area, -place.value) for place in lowest_first],
    )


def _drops(traversability: Traversability, reachable: MaskLayer, robot: RobotModel, config: HazardConfig) -> Layer:
    """Height by which the ground falls at the edges of the reachable ground, m; 0 elsewhere."""
    grid, elevation = traversability.grid, traversability.elevation.astype(np.float64)
    # Steps are not traversable, so ground above and below a step is in different pieces.
    pieces, _ = ndimage.label(~traversability.hazard & ~np.isnan(elevation))
    connected = np.isin(pieces, np.unique(pieces[reachable]))
    highest = ndimage.maximum_filter(np.where(connected, elevation, -np.inf), config.edge)
    is_edge = traversability.hazard & (np.abs(elevation - highest) < config.drop)
    is_edge &= grid.distance_to(reachable) <= robot.length
    drop = np.zeros(grid.shape)
    lowest = _lowest_beyond(grid, elevation, np.argwhere(is_edge), robot, config.drop)
    drop[is_edge] = elevation[is_edge] - lowest
    # Edges shorter than half the robot's width are seams between the arena's parts.
    return np.where(_long(drop >= config.drop, round(robot.half_width / grid.cell)), drop, 0.0)


def _lowest_beyond(grid: Grid, elevation: Layer, edges: Cells, robot: RobotModel, least_drop: float) -> Values:
    """Height of the lowest ground within the robot's length beyond each of the edges, m.

    The search goes this far because the camera often misses the nearest ground. It ignores gaps that the robot rolls
    over, as no wheel reaches their bottom. In each direction, it ends where the map is less than ``least_drop`` below
    the edge: at more of the same ground, or at a wall, behind which no robot falls.
    """
    height, middles = elevation[tuple(edges.T)][:, None], grid.centre_of(edges)[:, None]
    ground = _without_slits(elevation, 1 + 2 * int(robot.max_gap / 2 / grid.cell))
    count = ceil(2 * np.pi * robot.length / grid.cell)  # one for each cell on the circle
    bearings = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ahead = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    is_open = np.ones((len(edges), count), np.bool_)
    lowest = np.broadcast_to(height, is_open.shape)
    for distance in np.arange(grid.cell / 2, robot.length, grid.cell / 2):
        there = middles + distance * ahead
        has_left = (grid.cell_of(there) != edges[:, None]).any(axis=-1)
        is_open &= ~(has_left & (grid.at(elevation, there, outside=np.nan) > height - least_drop))
        lowest = np.fmin(lowest, np.where(is_open, grid.at(ground, there, outside=np.nan), np.nan))
    return lowest.min(axis=1)


def _without_slits(elevation: Layer, cells: int) -> Layer:
    """The heights, m, raised where low ground is narrower than ``cells``: a greyscale closing that ignores NaN."""
    raised = ndimage.maximum_filter(np.nan_to_num(elevation, nan=-np.inf), cells)
    closed = ndimage.minimum_filter(np.where(np.isneginf(raised), np.inf, raised), cells)
    return np.where(np.isnan(elevation), np.nan, closed)


def _long(edges: MaskLayer, cells: int) -> MaskLayer:
    """The connected edges with at least ``cells`` cells."""
    pieces, _ = ndimage.label(edges, np.ones((3, 3)))
    sizes = np.bincount(pieces.ravel())
    return edges & (sizes[pieces] >= cells)


def _headroom(traversability: Traversability, points: Points, at_least: float) -> Layer:
    """Height above the ground, m, of the lowest point that is at least ``at_least`` m above it; inf without one."""
    headroom = np.full(traversability.grid.shape, np.inf)
    above = points[:, 2] - traversability.grid.at(traversability.elevation, points, outside=np.nan)
    hangs = above >= at_least
    i, j = traversability.grid.cell_of(points[hangs]).T
    np.minimum.at(headroom, (i, j), above[hangs])
    return headroom
