"""Paint for rooms of plain polygons, so that a camera sees corners to follow."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame

TILE = 0.15
"""m, side of the cubes in each of which all surfaces have one grey."""


def painted(frame: Frame, T_world_base: NDArray[np.float64]) -> Frame:
    """The same frame, seen from a true pose (4×4), of a room with paint; pixels without returns are black."""
    T = T_world_base @ frame.T_base_camera
    points = (frame.intrinsics.rays * frame.depth[..., None]) @ T[:3, :3].T + T[:3, 3]
    cells = np.floor(points / TILE + 0.37).astype(np.int64) @ np.array([73856093, 19349663, 83492791])
    grey = np.where(frame.returns, np.random.default_rng(0).integers(30, 255, 997)[cells % 997], 0)
    return replace(frame, rgb=np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))
