"""The part of a large world that is built: as large as an arena may be, and as near as possible to the origin."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from pipeline.arrays import Places
from pipeline.transforms import transform_places
from sarsim.arenas.sdf.meshes import MeshSurface
from sarsim.arenas.sdf.pieces import pieces_of, with_volume
from sarsim.arenas.sdf.solids import Solid

ARENA_MARGIN = 4.0  # m by which an arena is longer and wider than its contents
USED_FRACTION = 0.98  # Fraction of the maximum area that is used, because cutting and rounding enlarge the area


@dataclass(frozen=True, eq=False)
class Window:
    """A rectangle of a world.

    Attributes:
        low, high: (2,) m, lowest and highest x, y.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def contains(self, place: NDArray[np.float64]) -> bool:
        """Whether the window contains a position (2,) m."""
        return bool(((self.low <= place) & (place <= self.high)).all())

    def __str__(self) -> str:
        x, y = self.high - self.low
        return f"{x:.0f} × {y:.0f} m around ({', '.join(f'{v:.0f}' for v in (self.low + self.high) / 2)}) m"


def window_of(boxes: NDArray[np.float64], area: float) -> Window:
    """The window of a world, centred as closely as possible on the objects' nearest point to the origin.

    ``boxes``: (N, 2, 2) m, lowest and highest x, y of each object; ``area``: maximum area of the arena, m².
    """
    low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    area *= USED_FRACTION
    room, extent = np.sqrt(area) - ARENA_MARGIN, high - low
    side = np.minimum(extent, room)
    if (extent > room).sum() == 1:  # long and narrow
        axis = int(np.argmax(extent))
        side[axis] = min(extent[axis], area / (side[1 - axis] + ARENA_MARGIN) - ARENA_MARGIN)
    nearest = np.clip(0.0, boxes[:, 0], boxes[:, 1])
    middle = nearest[np.linalg.norm(nearest, axis=1).argmin()]
    start = np.clip(middle - side / 2, low, high - side)
    return Window(start, start + side)


def solids_within(solids: list[Solid], window: Window) -> Iterator[Solid]:
    """Yield the parts of solids inside a window; a tile of ground whose centre is inside is kept whole."""
    for solid in solids:
        corners = transform_places(solid.T_world, solid.corners)[:, :2]
        low, high = corners.min(axis=0), corners.max(axis=0)
        if solid.kind == "plane" or ((low >= window.low).all() and (high <= window.high).all()):
            yield solid
        elif (high <= window.low).any() or (low >= window.high).any():
            continue
        elif solid.tile is None:
            yield from _cut(solid, window)
        elif ((window.low <= (low + high) / 2) & ((low + high) / 2 <= window.high)).all():
            yield solid


def _cut(solid: Solid, window: Window) -> Iterator[Solid]:
    R, t = solid.T_world[:3, :3], solid.T_world[:3, 3]
    vertices, triangles = _surface(solid)
    for axis in (0, 1):
        for sign, bound in ((1, window.low[axis]), (-1, window.high[axis])):
            normal = sign * np.eye(3)[axis]
            vertices, triangles, _ = trimesh.intersections.slice_faces_plane(
                vertices, triangles, R.T @ normal, R.T @ (normal * sign * bound - t)
            )
    if len(triangles) == 0:
        return
    if solid.piece is None or (len(solid.piece.parts) == 1 and with_volume(vertices) is vertices):
        with suppress(QhullError):  # raised if only a sliver is left
            vertices, triangles = _hull(vertices)  # a convex solid remains convex when cut
    for piece in pieces_of(MeshSurface("", vertices, triangles, solid.colour)):
        yield replace(solid, kind="mesh", size=np.zeros(0), corners=piece.vertices, piece=piece)


def _surface(solid: Solid) -> tuple[Places, NDArray[np.int64]]:
    """Vertices (N, 3) m and triangles (M, 3) of a solid's surface."""
    if solid.piece is not None and len(solid.piece.triangles):
        return solid.piece.vertices, solid.piece.triangles
    return _hull(solid.corners)


def _hull(points: Places) -> tuple[Places, NDArray[np.int64]]:
    """Vertices (K, 3) m and triangles (M, 3) of the convex hull of points (N, 3) m."""
    hull = ConvexHull(points)
    mesh = trimesh.Trimesh(points, hull.simplices, process=True)
    mesh.fix_normals()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)
