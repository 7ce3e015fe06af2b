"""The metric map for other programs: occupied voxels as PLY, and a 2D map for ROS."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Place
from pipeline.files import whole_file
from pipeline.labels import COLOURS
from pipeline.metric_map.metric_map import MetricMap
from pipeline.semantic_map.ply import write_ply

PGM_OCCUPIED, PGM_UNKNOWN, PGM_FREE = 0, 205, 254  # The grey values that ROS map_saver writes


def save_ply(path: Path, metric_map: MetricMap, labels: Labels | None = None) -> None:
    """Write the centres of the occupied voxels as binary PLY.

    Args:
        path: of the file.
        metric_map: whose voxels to write.
        labels: of ``metric_map.occupied_centres()``, which give them their colours; unlabelled if absent.

    Raises:
        InputError: if it cannot be written.
    """
    centres = metric_map.occupied_centres()
    labels = np.zeros(len(centres), np.uint8) if labels is None else labels
    write_ply(path, centres, COLOURS[labels], labels)


def save_map_server(path: Path, metric_map: MetricMap, lowest: float, highest: float) -> list[Path]:
    """Write a 2D map for ROS map_server: a PGM image at ``path`` and its description beside it as YAML.

    A cell is occupied if a voxel between the two heights is occupied, else free if one is free, else unknown. From
    0.25 to 0.65 m lies what stands in the way of a Pioneer 3-AT, but no ramp.

    Args:
        path: of the image, ``.pgm``.
        metric_map: whose voxels to write.
        lowest, highest: m in ``map``.

    Returns:
        The files that were written.

    Raises:
        InputError: if a file cannot be written.
    """
    lower, upper = metric_map.bounds()
    size = metric_map.voxel_size
    layers = metric_map.voxel_index([(0, 0, lowest), (0, 0, highest)])[:, 2]
    lower[2], upper[2] = layers[0], layers[1] + 1
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
    """Write an image for ROS map_server at ``path``, and its description beside it as YAML.

    Args:
        path: of the image, ``.pgm`` or, with opacity, ``.png``.
        cells: (nx, ny) grey, or (nx, ny, 2) grey and opacity: a cell that is not opaque is unknown.
        cell: side of a cell, m.
        origin: xy of the corner of the first cell.
        mode: trinary or scale, how map_server reads the greys.
        thresholds: darkness, 0 to 1: below the first a cell is free, above the second occupied.

    Returns:
        The files that were written.

    Raises:
        InputError: if a file cannot be written.
    """
    image = np.ascontiguousarray(np.swapaxes(cells, 0, 1)[::-1])
    if image.ndim == 3:
        image = image[..., [0, 0, 0, 1]]
    with whole_file(path) as partial:
        partial.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())
    free, occupied = thresholds
    description = path.with_suffix(".yaml")
    with whole_file(description) as partial:
        partial.write_text(
            f"image: {path.name}\nmode: {mode}\nresolution: {cell}\norigin: [{origin[0]:.6g}, {origin[1]:.6g}, 0.0]\n"
            f"negate: 0\noccupied_thresh: {occupied}\nfree_thresh: {free}\n"
        )
    return [path, description]
