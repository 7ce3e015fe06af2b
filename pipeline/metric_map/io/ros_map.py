"""Writes the traversability as 2D maps that ROS map_server (Nav2) loads."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from pipeline.arrays import Place
from pipeline.elevation_map.traversability import Traversability
from pipeline.metric_map.io.exports import PGM_FREE, PGM_OCCUPIED, PGM_UNKNOWN, write_map_server

LETHAL_COST, STEEPEST_COST = 100, 98
"""Costs for map_server of ground that the robot cannot drive on, and of the steepest slope that it can drive on."""
SCALE_THRESHOLDS = (0.005, 0.995)
"""Thresholds of darkness for free and occupied cells, between which each shade of grey is a different cost."""


def save_ros_map(path: Path, traversability: Traversability, places: ArrayLike) -> list[Path]:
    """Write ``path`` (.pgm) with free, lethal and unknown cells, ..._cost.png with costs of slopes, and .yaml files.

    Lethal cells contain walls, steps, or slopes too steep for the robot. They are not inflated, because Nav2 inflates
    them by the footprint in its settings.

    Args:
        path: the .pgm image.
        traversability: traversability of the ground.
        places: (N, 2 or 3) positions of the robot, m; ground not connected to them by known ground is left unknown.

    Returns:
        The files that were written.

    Raises:
        InputError: a file cannot be written.
    """
    cost, origin = known_costs(traversability, places)
    cell = traversability.grid.cell
    files = write_map_server(path, trinary(cost), cell, origin)
    white = np.iinfo(np.uint8).max
    shade = np.rint(white * (1 - np.maximum(cost, 0) / LETHAL_COST))
    scaled = np.stack([shade, white * (cost >= 0)], axis=-1).astype(np.uint8)
    return files + write_map_server(
        path.with_name(f"{path.stem}_cost.png"), scaled, cell, origin, "scale", SCALE_THRESHOLDS
    )


def known_costs(traversability: Traversability, places: ArrayLike) -> tuple[NDArray[np.int64], Place]:
    """(nx, ny) the part of :func:`costs` around all known cells, and (2,) the lower corner of its first cell, m."""
    cost, grid = costs(traversability, places), traversability.grid
    found = ndimage.find_objects((cost >= 0).astype(np.int8))
    i, j = found[0] if found else (slice(0, 1), slice(0, 1))
    return cost[i, j], grid.origin + np.array([i.start, j.start]) * grid.cell


def trinary(cost: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(nx, ny) uint8 grey values of map_saver for costs (nx, ny): free, occupied or unknown."""
    return np.select([cost < 0, cost == LETHAL_COST], [PGM_UNKNOWN, PGM_OCCUPIED], PGM_FREE).astype(np.uint8)


def costs(traversability: Traversability, places: ArrayLike) -> NDArray[np.int64]:
    """(nx, ny) costs: 0 on level ground to :data:`STEEPEST_COST` on slopes; :data:`LETHAL_COST`; -1 if unknown."""
    t = traversability
    lethal, known = t.hazard, np.isfinite(t.elevation)
    parts, _ = ndimage.label(known & ~lethal)
    joined = np.isin(parts, np.setdiff1d(parts[t.grid.mask_of(places)], [0]))
    tilt = np.arctan(np.linalg.norm(t.gradient, axis=-1)) / t.robot.max_tilt
    return np.select([lethal, joined], [LETHAL_COST, np.rint(STEEPEST_COST * tilt.clip(0, 1))], -1).astype(np.int64)
