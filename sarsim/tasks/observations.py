"""Observations of an exploring agent: local maps of the robot's surroundings, from its own maps, and viewpoints."""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Pose, Rgb
from pipeline.labels import COLOURS, Label
from pipeline.mapper import Mapper
from pipeline.semantic_map.semantic_map import SemanticMap

VIEWPOINTS = 32
"""Maximum number of viewpoints from which an agent chooses."""
LOCAL_SIDE, LOCAL_CELL = 64, 0.2
"""Number of rows, and of columns, of the local maps; side of a cell, m."""
MAX_COORDINATE = 10_000.0
"""Maximum magnitude to which coordinates in observations are clipped, m."""
ROBOT_COLOUR = (220, 40, 40)

Maps = dict[str, NDArray[Any]]


def observation_space() -> spaces.Dict:
    """The observation space; see :class:`sarsim.tasks.explore.Explore`."""
    far = MAX_COORDINATE
    low, high = np.array([-far, -far, -1, -1], np.float32), np.array([far, far, 1, 1], np.float32)
    return spaces.Dict(
        {
            "elevation": spaces.Box(-far, far, (LOCAL_SIDE, LOCAL_SIDE), np.float32),
            "label": spaces.Box(0, max(Label), (LOCAL_SIDE, LOCAL_SIDE), np.uint8),
            "seen": spaces.Box(0, 1, (LOCAL_SIDE, LOCAL_SIDE), np.uint8),
            "pose": spaces.Box(low, high, dtype=np.float32),
            "viewpoints": spaces.Box(-far, far, (VIEWPOINTS, 4), np.float32),
            "frontiers": spaces.Box(0, far, (1,), np.float32),
        }
    )


def observation(
    maps: Mapping[str, NDArray[Any]], place: ArrayLike, heading: float, viewpoints: ArrayLike, frontiers: int
) -> Maps:
    """An observation, clipped to the bounds of its space.

    Args:
        maps: ``elevation``, ``label`` and ``seen``, (64, 64).
        place: (2,) x and y from the start, m.
        heading: heading of the robot, rad.
        viewpoints: (N, 4) rows of the observation's ``viewpoints``, at most 32.
        frontiers: number of frontiers.
    """
    far, rows = MAX_COORDINATE, np.zeros((VIEWPOINTS, 4), np.float32)
    found = np.asarray(viewpoints, np.float64).reshape(-1, 4)
    rows[: len(found)] = np.clip(found, -far, far)
    pose = np.clip(np.array([*np.asarray(place), np.cos(heading), np.sin(heading)], np.float32), -far, far)
    count = np.array([min(frontiers, far)], np.float32)
    return {**maps, "pose": pose, "viewpoints": rows, "frontiers": count}


def local_maps(mapper: Mapper, T_map_base: Pose) -> Maps:
    """``elevation``, ``label`` and ``seen`` (64, 64) around a robot, rows along y, columns along x.

    - ``elevation``: height, m, of the highest known ground in each cell, relative to ``base_link``; 0 where unknown;
    - ``label``: the most frequent class of the cell's labelled points except ceilings; 0 if there are none;
    - ``seen``: whether any ground in the cell has been seen.

    Args:
        mapper: the robot's mapper, which holds its maps.
        T_map_base: 4×4 pose of the robot in ``map``.
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
    """(H, W + H, 3) RGB, the camera's image and a plan of the classes around the robot: y up, the robot in red."""
    colours = np.where(maps["seen"][..., None] > 0, COLOURS[maps["label"]], 0).astype(np.uint8)
    colours[LOCAL_SIDE // 2 - 1 : LOCAL_SIDE // 2 + 1, LOCAL_SIDE // 2 - 1 : LOCAL_SIDE // 2 + 1] = ROBOT_COLOUR
    side = len(rgb)
    plan = cv2.resize(colours[::-1], (side, side), interpolation=cv2.INTER_NEAREST)
    return np.concatenate([rgb, plan.astype(np.uint8)], axis=1)
