"""The true plane faces of an arena's geoms."""

from dataclasses import dataclass

import mujoco
import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Direction, Places
from pipeline.labels import PLANAR, Label
from sarsim.ground_truth.columns import plane_corners
from sarsim.ground_truth.meshes import DRAWN_GROUPS
from sarsim.ground_truth.shapes import CUBE, hull_planes, mesh_vertices
from sarsim.sensors.camera import geom_labels


@dataclass(frozen=True, eq=False)
class Face:
    """A convex plane face of a geom.

    Attributes:
        geom: id of the geom.
        label: label of the geom.
        normal: outward normal.
        outline: (N, 3) m, corners in the world, in order around the face.
    """

    geom: int
    label: Label
    normal: Direction
    outline: Places


def true_faces(model: mujoco.MjModel, data: mujoco.MjData) -> list[Face]:
    """The faces of all planes, boxes and meshes that are drawn and carry a planar label.

    A mesh that can collide has the faces of its convex hull; any other mesh has those of its triangles.
    """
    labels = geom_labels(model)
    faces = []
    for geom in map(int, np.flatnonzero(np.isin(labels, PLANAR) & np.isin(model.geom_group, DRAWN_GROUPS))):
        label, R, position = Label(labels[geom]), data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        vertices = _vertices(model, data, geom)
        if vertices is None:
            continue
        is_mesh = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
        if is_mesh and not (model.geom_contype[geom] | model.geom_conaffinity[geom]):
            mesh = model.geom_dataid[geom]
            first = model.mesh_faceadr[mesh]
            triangles = vertices[model.mesh_face[first : first + model.mesh_facenum[mesh]]]
            faces += _faces_of_triangles(geom, label, triangles @ R.T + position)
        else:
            faces += _faces(geom, label, vertices @ R.T + position)
    return faces


def _faces_of_triangles(geom: int, label: Label, triangles: NDArray[np.float64]) -> list[Face]:
    """One face per plane of the triangles (N, 3, 3), m; its outline is the convex hull of the plane's triangles."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    planes = np.column_stack([normals, (normals * triangles[:, 0]).sum(axis=1)]).round(3)
    _, first, which = np.unique(planes, axis=0, return_index=True, return_inverse=True)
    faces = []
    for n, normal in enumerate(normals[first]):
        corners, axes = triangles[which.ravel() == n].reshape(-1, 3), np.stack(plane_axes(normal))
        hull = shapely.MultiPoint(corners @ axes.T).convex_hull
        if isinstance(hull, shapely.Polygon):
            inside = np.array(hull.exterior.coords)[:-1] @ axes
            faces.append(Face(geom, label, normal, inside + normal * (corners[0] @ normal)))
    return faces


def _vertices(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> NDArray[np.float64] | None:
    """(N, 3) corners of a geom in its own frame; None unless it is a plane, box or mesh."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        return plane_corners(model, data, geom)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return CUBE * size
    return mesh_vertices(model, geom) if kind == mujoco.mjtGeom.mjGEOM_MESH else None


def _faces(geom: int, label: Label, vertices: NDArray[np.float64]) -> list[Face]:
    """The faces of the convex hull of vertices; four coplanar vertices are a plane geom, with only an upper face."""
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
    x = _cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    return x, _cross(normal, x)


def _cross(a: NDArray[np.float64], b: ArrayLike) -> NDArray[np.float64]:
    """The cross product of two vectors (3,); ten times as fast as NumPy's."""
    (x, y, z), (u, v, w) = a, np.asarray(b)
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
