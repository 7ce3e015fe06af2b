"""Exports the metric map to other programs: occupied voxels as PLY, and a 2D map for ROS."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Place
from pipeline.files import atomic_write
from pipeline.labels import COLOURS
from pipeline.metric_map.metric_map import MetricMap
from pipeline.semantic_map.ply import write_ply

PGM_OCCUPIED, PGM_UNKNOWN, PGM_FREE = 0, 205, 254  # Grey values that ROS map_saver writes


def save_ply(path: Path, metric_map: MetricMap, labels: Labels | None = None) -> None:
    """Write the centres of the occupied voxels as binary PLY.

    Args:
        path: the ``.ply`` file.
        metric_map: the map.
        labels: (N,) classes of ``metric_map.occupied_centres()``, which determine the colours; unlabelled if None.

    Raises:
        InputError: the file cannot be written.
    """
    centres = metric_map.occupied_centres()
    labels = np.zeros(len(centres), np.uint8) if labels is None else labels
    write_ply(path, centres, COLOURS[labels], labels)


def save_map_server(path: Path, metric_map: MetricMap, lowest: float, highest: float) -> list[Path]:
    """Write a 2D map for ROS map_server: a PGM image at ``path`` and its YAML description next to it.

    A cell is occupied if a voxel between the two heights is occupied, else free if one is free, else unknown. Heights
    from 0.25 to 0.65 m contain the obstacles to a Pioneer 3-AT on level ground.

    Args:
        path: the image, ``.pgm``.
        metric_map: the map.
        lowest, highest: heights in ``map``, m; infinite if there is no limit.

    Returns:
        The files that were written.

    Raises:
        InputError: a file cannot be written.
    """
    lower, upper = metric_map.bounds()
    size = metric_map.voxel_size
    first, last = np.floor((np.array([lowest, highest]) - metric_map.corner[2]) / size)
    lower[2], upper[2] = np.clip([first, last + 1], lower[2], upper[2])
    upper[:2] = np.maximum(upper[:2], lower[:2] + 1)  # A map without known voxels is one unknown cell
    log_odds = metric_map.log_odds(lower, upper)
    cells = np.where((log_odds > 0).any(axis=2), PGM_OCCUPIED, PGM_UNKNOWN)
    cells[(log_odds < 0).any(axis=2) & (cells != PGM_OCCUPIED)] = PGM_FREE
    return write_map_server(path, cells.astype(np.uint8), size, lower[:2] * size + metric_map.corner[:2])


def write_map_server(
    path: Path,
    cells: NDArray[np.uint8],
    cell: float,
    origin: Place,
    mode: str = "trinary",
    thresholds: tuple[float, float] = (0.196, 0.65),
) -> list[Path]:
    """Write an image for ROS map_server at ``path`` and its YAML description next to it.

    Args:
        path: the image, ``.pgm`` or, with opacity, ``.png``.
        cells: (nx, ny) grey values, or (nx, ny, 2) grey values and opacities; a cell that is not opaque is unknown.
        cell: side of a cell, m.
        origin: (2,) lower corner of the first cell, m.
        mode: how map_server interprets grey values, ``trinary`` or ``scale``.
        thresholds: darkness (0 to 1) below which a cell is free, and above which it is occupied.

    Returns:
        The files that were written.

    Raises:
        InputError: a file cannot be written.
    """
    image = np.ascontiguousarray(np.swapaxes(cells, 0, 1)[::-1])
    if image.ndim == 3:
        image = image[..., [0, 0, 0, 1]]
    with atomic_write(path) as partial:
        partial.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())
    free, occupied = thresholds
    description = path.with_suffix(".yaml")
    with atomic_write(description) as partial:
        partial.write_text(
            f"image: {path.name}\nmode: {mode}\nresolution: {cell}\norigin: [{origin[0]:.6g}, {origin[1]:.6g}, 0.0]\n"
            f"negate: 0\noccupied_thresh: {occupied}\nfree_thresh: {free}\n"
        )
    return [path, description]
