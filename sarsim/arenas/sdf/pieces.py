"""Convex pieces of a surface: MuJoCo and the true ground take every geom for its convex hull.

A connected piece of a mesh that is closed and convex stays whole. Any other is laid with thin plates, one for
each flat, convex facet, or else one for each of its triangles, so that rooms, doorways and stairs stay open.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from pipeline.arrays import Places, Rotation3
from sarsim.arenas.sdf.colours import Colour
from sarsim.arenas.sdf.meshes import MeshSurface

THICKNESS = 2e-4  # m of a plate: rays from its other side keep the 1 mm to which the numbers of the file are held
SLIVER = 1e-4  # m; a triangle whose height is less is a line
PRISM = np.array([(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)])
"""(8, 3) triangles of a prism over the triangle 0, 1, 2, counter-clockwise from outside."""
MOST_PIECES = 2_000  # of a mesh, and plates of a piece; compiling a mesh and its geom takes 4 ms


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """A connected piece of a surface.

    Attributes:
        vertices: (N, 3) m.
        triangles: (M, 3) indices of vertices.
        parts: (K, 3) m each, the corners of the convex parts that it is built of; empty if these are too many.
        colour: of the surface.
    """

    vertices: Places
    triangles: NDArray[np.int64]
    parts: list[Places]
    colour: Colour | None

    @property
    def parts_per_metre(self) -> float:
        """Number of parts over the piece's extent, 1/m."""
        return len(self.parts) / max(float(np.linalg.norm(np.ptp(self.vertices, axis=0))), SLIVER)

    @property
    def is_flat(self) -> bool:
        """Whether the piece fills no space, so that it has no hull."""
        try:
            hull = ConvexHull(self.vertices)
        except QhullError:
            return True
        return bool(hull.volume <= SLIVER * hull.area)

    @property
    def slab(self) -> NDArray[np.float64]:
        """(2 N, 3) m corners of the plate whose one face is the hull of a flat piece."""
        normal = np.linalg.svd(self.vertices - self.vertices.mean(axis=0), full_matrices=False)[2][2]
        return np.concatenate([self.vertices, self.vertices - THICKNESS * normal])

    def area_up(self, R: Rotation3) -> float:
        """m² of the piece, turned by ``R`` (3, 3), that face up, as steep as they may be."""
        a, b, c = self.vertices[self.triangles].swapaxes(0, 1)
        return float(np.maximum(np.cross(b - a, c - a) @ R[2] / 2, 0.0).sum())


def pieces_of(surface: MeshSurface) -> Iterator[MeshPiece]:
    """The connected pieces of a surface."""
    mesh = trimesh.Trimesh(surface.vertices, surface.triangles, process=True)
    mesh.update_faces(mesh.nondegenerate_faces(height=SLIVER) & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    groups = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=1)
    for faces in sorted(groups, key=min) if len(groups) <= MOST_PIECES else [np.arange(len(mesh.faces))]:
        piece: Any = mesh.submesh([np.sort(faces)], append=True, repair=False)
        yield MeshPiece(np.asarray(piece.vertices), np.asarray(piece.faces), _parts(piece), surface.colour)


def _parts(mesh: trimesh.Trimesh) -> list[NDArray[np.float64]]:
    if mesh.is_watertight and mesh.is_convex:
        return [np.asarray(mesh.vertices)]
    facets = list(mesh.facets)
    single = np.setdiff1d(np.arange(len(mesh.faces)), np.concatenate([*facets, np.zeros(0, np.int64)]))
    if len(facets) + len(single) > MOST_PIECES:
        return []
    return [plate for faces in [*facets, *single[:, None]] for plate in _plates_of(mesh, faces)]


def _plates_of(mesh: trimesh.Trimesh, faces: NDArray[np.int64]) -> Iterator[NDArray[np.float64]]:
    """The plates below adjacent triangles that lie nearly in one plane."""
    corners = mesh.vertices[np.unique(mesh.faces[faces])]
    largest = faces[mesh.area_faces[faces].argmax()]
    normal = mesh.face_normals[largest]
    height = (corners - mesh.vertices[mesh.faces[largest, 0]]) @ normal
    area = float(mesh.area_faces[faces].sum())
    if len(faces) == 1 or (np.abs(height).max() <= SLIVER and _is_convex(corners, normal, area)):
        yield np.concatenate([corners, corners - THICKNESS * normal])
    else:
        for face in faces:
            yield from _plates_of(mesh, np.array([face]))


def _is_convex(corners: NDArray[np.float64], normal: NDArray[np.float64], area: float) -> bool:
    """Whether triangles in a plane, of a total area in m², fill the convex hull of their corners (N, 3)."""
    along = np.linalg.svd(normal[None])[2][1:]  # two directions in the plane
    try:
        hull = ConvexHull(corners @ along.T)
    except QhullError:
        return False
    return bool(abs(hull.volume - area) <= SLIVER * hull.area)  # of a plane figure: its area, and its perimeter


def extruded(outlines: list[NDArray[np.float64]], height: float) -> MeshPiece:
    """Outlines (N, 2) m extruded from z = 0 to ``height`` m, in convex parts; one within another is a hole.

    ValueError if they enclose nothing.
    """
    area = shapely.Polygon()
    for outline in outlines:
        area = area.symmetric_difference(shapely.make_valid(shapely.Polygon(outline)))
    triangles = shapely.orient_polygons(shapely.get_parts(shapely.constrained_delaunay_triangles(area)))
    if not len(triangles):
        raise ValueError("the polylines enclose nothing")
    bases = [np.pad(shapely.get_coordinates(triangle)[:3], ((0, 0), (0, 1))) for triangle in triangles]
    parts = [np.concatenate([base, base + np.array([0, 0, height])]) for base in bases]
    faces = np.concatenate([PRISM + 6 * n for n in range(len(parts))])
    return MeshPiece(np.concatenate(parts), faces, parts, None)
