"""The true plane faces of an arena's geoms."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Places
from pipeline.labels import PLANAR, Label
from sarsim.ground_truth.columns import ENDLESS
from sarsim.ground_truth.shapes import CUBE, SQUARE, hull_planes, mesh_vertices
from sarsim.sensors.camera import geom_labels


@dataclass(frozen=True, eq=False)
class Face:
    """A convex plane face of a geom.

    Attributes:
        geom: its id.
        label: of the geom.
        normal: outward.
        outline: in the world, in order around the face.
    """

    geom: int
    label: Label
    normal: Direction
    outline: Places


def true_faces(model: mujoco.MjModel, data: mujoco.MjData) -> list[Face]:
    """The faces of all planes, boxes and (convex) meshes that carry a planar label."""
    labels = geom_labels(model)
    faces = []
    for geom in np.flatnonzero(np.isin(labels, PLANAR)):
        vertices = _vertices(model, int(geom))
        if vertices is not None:
            world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            faces += _faces(int(geom), Label(labels[geom]), world)
    return faces


def _vertices(model: mujoco.MjModel, geom: int) -> NDArray[np.float64] | None:
    """(N, 3) corners of a geom in its own frame; None if it is round."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return SQUARE * np.where(size > 0, size, ENDLESS)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return CUBE * size
    return mesh_vertices(model, geom) if kind == mujoco.mjtGeom.mjGEOM_MESH else None


def _faces(geom: int, label: Label, vertices: NDArray[np.float64]) -> list[Face]:
    """The faces of the convex hull of vertices; four in one plane are a plane geom, whose face is its upper side."""
    if len(vertices) == 4 and np.linalg.matrix_rank(vertices[1:] - vertices[0]) == 2:
        normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
        return [Face(geom, label, normal / np.linalg.norm(normal), vertices)]
    return [Face(geom, label, plane[:3], _outline(vertices, plane)) for plane in hull_planes(vertices)]


def _outline(vertices: NDArray[np.float64], plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices on a plane, in order around their mean."""
    on_plane = vertices[np.abs(vertices @ plane[:3] - plane[3]) < 1e-4]
    x, y = plane_axes(plane[:3])
    offset = on_plane - on_plane.mean(axis=0)
    return on_plane[np.argsort(np.arctan2(offset @ y, offset @ x))]


def plane_axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two perpendicular unit vectors (3,) in the plane with a normal (3,)."""
    x = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return x, np.cross(normal, x)
