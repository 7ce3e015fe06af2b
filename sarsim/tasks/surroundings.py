"""Local maps of what a robot knows about its surroundings."""

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose, Rgb
from pipeline.labels import COLOURS, Label
from pipeline.mapper import Mapper
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.tasks.exploration_task import LOCAL_SIDE, ROBOT_COLOUR, Maps

LOCAL_CELL = 0.2
"""Side of a cell of the local maps, m, as in ``Explore2D-v0`` with the rules ``camera``."""


def local_maps(mapper: Mapper, T_map_base: Pose) -> Maps:
    """``elevation``, ``label`` and ``seen`` (64, 64) around a robot, rows along y, columns along x.

    ``elevation``: height of the highest known ground in a cell above the ground at the robot, m, 0 where unknown;
    ``label``: the most frequent class of its labelled points other than ceilings, 0 if there are none;
    ``seen``: whether any ground in it has been seen.

    Args:
        mapper: the robot's mapper, which holds its maps.
        T_map_base: pose of the robot.
    """
    grid, layers = mapper.elevation_map.grid, mapper.elevation_map
    per_cell = round(LOCAL_CELL / grid.cell)
    fine = (np.arange(LOCAL_SIDE * per_cell) + 0.5) * grid.cell - LOCAL_SIDE * LOCAL_CELL / 2
    places = T_map_base[:2, 3] + np.stack(np.meshgrid(fine, fine), axis=-1)
    height, measured = (grid.at(layer, places, np.nan) for layer in (layers.elevation, layers.measured))
    blocks = (LOCAL_SIDE, per_cell, LOCAL_SIDE, per_cell)
    highest = np.where(np.isnan(height), -np.inf, height).reshape(blocks).max(axis=(1, 3))
    elevation = np.where(np.isfinite(highest), highest - T_map_base[2, 3], 0)
    return {
        "elevation": elevation.astype(np.float32),
        "label": _classes(mapper.semantic_map, T_map_base[:2, 3]),
        "seen": np.isfinite(measured).reshape(blocks).any(axis=(1, 3)).astype(np.uint8),
    }


def _classes(known: SemanticMap, middle: NDArray[np.float64]) -> NDArray[np.uint8]:
    points, labels = known.points(), known.labels()
    col, row = (np.floor((points[:, :2] - middle) / LOCAL_CELL).astype(int) + LOCAL_SIDE // 2).T
    is_in = (row >= 0) & (row < LOCAL_SIDE) & (col >= 0) & (col < LOCAL_SIDE) & (labels != Label.CEILING)
    index = (row * LOCAL_SIDE + col)[is_in] * len(Label) + labels[is_in]
    counts = np.bincount(index, minlength=LOCAL_SIDE**2 * len(Label))
    return counts.reshape(LOCAL_SIDE, LOCAL_SIDE, len(Label)).argmax(axis=2).astype(np.uint8)


def picture(rgb: Rgb, maps: Maps) -> NDArray[np.uint8]:
    """(H, W + H, 3) the camera's image, and the classes around the robot, with y up and the robot in red."""
    colours = np.where(maps["seen"][..., None] > 0, COLOURS[maps["label"]], 0).astype(np.uint8)
    colours[LOCAL_SIDE // 2 - 1 : LOCAL_SIDE // 2 + 1, LOCAL_SIDE // 2 - 1 : LOCAL_SIDE // 2 + 1] = ROBOT_COLOUR
    side = len(rgb)
    plan = cv2.resize(colours[::-1], (side, side), interpolation=cv2.INTER_NEAREST)
    return np.concatenate([rgb, plan.astype(np.uint8)], axis=1)
