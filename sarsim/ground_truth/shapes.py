"""The shapes of a model's geoms, in their own frames: corners, hulls, and surfaces swept around the z axis."""

from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pipeline.arrays import Places, Rotation3

SQUARE = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
"""(4, 3) corners of a square with half sizes 1, counter-clockwise from above."""
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
"""(8, 3) corners of a box with half sizes 1."""


def rotation(quat: NDArray[np.float64]) -> Rotation3:
    """Rotation matrix of a (4,) quaternion w x y z."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def mesh_vertices(model: mujoco.MjModel, geom: int) -> Places:
    """(N, 3) m, the vertices of a mesh geom in its own frame."""
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    return model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(np.float64)


def field_points(model: mujoco.MjModel, geom: int) -> NDArray[np.float64]:
    """(rows, columns, 3) m, the points of a height field geom in its own frame; y increases with the row."""
    field = model.geom_dataid[geom]
    rows, columns, start = model.hfield_nrow[field], model.hfield_ncol[field], model.hfield_adr[field]
    x_half, y_half, top, _ = model.hfield_size[field]
    height = model.hfield_data[start : start + rows * columns].reshape(rows, columns) * float(top)
    x, y = np.linspace(-x_half, x_half, columns), np.linspace(-y_half, y_half, rows)
    return np.stack([*np.meshgrid(x, y), height], axis=-1)


def field_triangles(model: mujoco.MjModel, geom: int) -> NDArray[np.float64]:
    """(N, 3, 3) m, the triangles of a height field geom, counter-clockwise from above; cells split as in MuJoCo."""
    points = field_points(model, geom)
    first, along, across, up = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    halves = [np.stack([first, along, across], axis=2), np.stack([first, across, up], axis=2)]
    return np.concatenate([half.reshape(-1, 3, 3) for half in halves])


def hull_planes(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M, 4) distinct planes (n, d) of the convex hull of (N, 3) vertices, n·p ≤ d inside, rounded to 1 µm."""
    return _hull_planes(vertices.tobytes())


@lru_cache(256)
def _hull_planes(vertices: bytes) -> NDArray[np.float64]:
    """As :func:`hull_planes`; cached, because arenas consist of few distinct shapes and are surveyed repeatedly."""
    return np.unique(ConvexHull(np.frombuffer(vertices).reshape(-1, 3)).equations.round(6), axis=0) * [1, 1, 1, -1]


def swept(outline: NDArray[np.float64], segments: int) -> NDArray[np.float64]:
    """(K · segments, 3) m, points on rings around the z axis, one ring for each of the (K, 2) points (r, z), m."""
    angle = np.arange(segments) * 2 * np.pi / segments
    xy = outline[:, None, :1] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    z = np.broadcast_to(outline[:, None, 1:], (*xy.shape[:2], 1))
    return np.concatenate([xy, z], axis=2).reshape(-1, 3)
