"""Connected pieces of a surface: their visible triangles, and the convex parts with which the robot collides.

MuJoCo and the true ground treat every colliding geom as its convex hull. A closed, convex piece becomes one geom. Any
other piece is drawn unchanged, but collides as a few convex parts, so that rooms, doorways and stairs stay open.
These parts are either prisms between the two sides of a wall or thin plates on the facets.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from pipeline.arrays import Places, Rotation3
from sarsim.arenas.sdf.colours import Colour
from sarsim.arenas.sdf.convex import SLIVER, THICKNESS, plates, prisms
from sarsim.arenas.sdf.meshes import MeshSurface

PRISM_TRIANGLES = np.array([(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)])
"""(8, 3) indices of corners: triangles of a prism with ends 0, 1, 2 and 3, 4, 5, counter-clockwise from outside."""
THICKNESSES = THICKNESS, 10 * THICKNESS, 100 * THICKNESS
"""m, thicknesses of plates on flat parts, in the order in which they are tried; far from the origin, single precision
does not resolve the thinnest plate."""
MIN_VOLUME_PER_AREA = THICKNESS / 10
"""m, ratio of volume to area below which a part is flat; a plate's is half its thickness."""
MAX_PIECES = 2_000  # Maximum numbers of a mesh's pieces, a world's convex parts and a piece's facets; 2 ms per geom


@dataclass(frozen=True, eq=False)
class MeshPiece:
    """A connected piece of a surface.

    Attributes:
        vertices: (N, 3) m, corners of the triangles.
        triangles: (M, 3) indices of vertices.
        parts: corners of its convex parts, each (K, 3) m; empty if there are too many.
        colour: colour of the surface; None if the file gives none.
        facets: (M,) index of each triangle's flat facet; None unless the surface is drawn and the parts only collide.
    """

    vertices: Places
    triangles: NDArray[np.int64]
    parts: list[Places]
    colour: Colour | None
    facets: NDArray[np.int64] | None = None

    @cached_property
    def facet_triangles(self) -> list[NDArray[np.float64]]:
        """The triangles of each facet, (K, 3, 3) m; empty unless the surface is drawn and the parts only collide."""
        if self.facets is None:
            return []
        order = np.argsort(self.facets, kind="stable")
        ends = np.cumsum(np.bincount(self.facets))[:-1]
        return np.split(self.vertices[self.triangles[order]], ends)

    @property
    def parts_per_metre(self) -> float:
        """Number of parts divided by the piece's extent, 1/m."""
        return len(self.parts) / max(float(np.linalg.norm(np.ptp(self.vertices, axis=0))), SLIVER)

    def upward_area(self, R: Rotation3) -> float:
        """Area projected on the ground, m², of the triangles that face up if the piece is rotated by ``R`` (3, 3)."""
        a, b, c = self.vertices[self.triangles].swapaxes(0, 1)
        return float(np.maximum(np.cross(b - a, c - a) @ R[2] / 2, 0.0).sum())


def with_volume(corners: Places) -> Places | None:
    """Corners (N, 3) m of a part or, if the part is flat, of a thin plate on it; None if the part is only a line.

    MuJoCo stores corners in single precision, and finds no hull of a part without volume.
    """
    if _has_volume(corners):
        return corners
    normal = np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2][-1]
    plates = (np.concatenate([corners, corners - thickness * normal]) for thickness in THICKNESSES)
    return next(filter(_has_volume, plates), None)


def _has_volume(corners: Places) -> bool:
    try:
        hull = ConvexHull(corners.astype(np.float32))
    except (QhullError, ValueError):
        return False
    return bool(hull.volume > MIN_VOLUME_PER_AREA * hull.area)


def pieces_of(surface: MeshSurface) -> Iterator[MeshPiece]:
    """Yield the connected pieces of a surface, or the whole surface if there are more than ``MAX_PIECES``."""
    mesh = trimesh.Trimesh(surface.vertices, surface.triangles, process=True)
    mesh.update_faces(mesh.nondegenerate_faces(height=SLIVER) & mesh.unique_faces())
    mesh.remove_unreferenced_vertices()
    groups = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=1)
    for faces in sorted(groups, key=min) if len(groups) <= MAX_PIECES else [np.arange(len(mesh.faces))]:
        piece: Any = mesh.submesh([np.sort(faces)], append=True, repair=False)
        yield _piece(piece, surface.colour)


def _piece(mesh: trimesh.Trimesh, colour: Colour | None) -> MeshPiece:
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if mesh.is_watertight and mesh.is_convex:
        return MeshPiece(vertices, triangles, [vertices], colour)
    facets = [np.asarray(faces) for faces in mesh.facets]
    single = np.setdiff1d(np.arange(len(triangles)), np.concatenate([*facets, np.zeros(0, np.int64)]))
    if len(facets) + len(single) > MAX_PIECES:
        return MeshPiece(vertices, triangles, [], colour)
    facets += list(single[:, None])
    number = np.empty(len(triangles), np.int64)
    for n, faces in enumerate(facets):
        number[faces] = n
    return MeshPiece(vertices, triangles, prisms(mesh) or list(plates(mesh, facets)), colour, number)


def two_sided(triangles: NDArray[np.float64]) -> tuple[Places, NDArray[np.int64]]:
    """Vertices and triangles of a mesh that shows triangles (N, 3, 3) m from both sides, with flat shading."""
    vertices = np.concatenate([triangles, triangles[:, ::-1]]).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def extruded(outlines: list[NDArray[np.float64]], height: float) -> MeshPiece:
    """Extrude outlines (N, 2) m from z = 0 to ``height`` m; an outline inside another outline is a hole.

    Raises:
        ValueError: the outlines enclose no area.
    """
    area = shapely.Polygon()
    for outline in outlines:
        area = area.symmetric_difference(shapely.make_valid(shapely.Polygon(outline)))
    triangles = shapely.orient_polygons(shapely.get_parts(shapely.constrained_delaunay_triangles(area)))
    if not len(triangles):
        raise ValueError("the polylines enclose no area")
    bases = [np.pad(shapely.get_coordinates(triangle)[:3], ((0, 0), (0, 1))) for triangle in triangles]
    parts = [np.concatenate([base, base + np.array([0, 0, height])]) for base in bases]
    faces = np.concatenate([PRISM_TRIANGLES + 6 * n for n in range(len(parts))])
    return MeshPiece(np.concatenate(parts), faces, parts, None)
