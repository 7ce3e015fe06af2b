"""Replaces a surface with a few convex parts for collisions: prisms between its two sides, or plates on its facets.

Only the robot collides with the parts, while images and rays see the surface itself. The parts may therefore deviate
from the surface by up to ``MAX_DEVIATION``.
"""

from collections.abc import Iterable, Iterator
from math import hypot

import numpy as np
import trimesh
from numpy.typing import NDArray

from pipeline.arrays import Direction, Places

THICKNESS = 2e-4  # m, thickness of a plate
SLIVER = 1e-4  # m; a triangle with a smaller height is treated as a line
MAX_DEVIATION = 1e-3  # m by which a part may fill a concave corner of its surface
MAX_LEAN = 0.1  # m, maximum offset across the axis between the two ends of a prism's side edge
MAX_SIDE_COSINE = 0.03  # Maximum cosine of the angle between the normal of a prism's side and the prism's axis
MIN_END_COSINE = 0.2  # Minimum cosine of the angle between the normal of a prism's end and the prism's axis
MAX_OPEN_WIDTH = 1.0
"""m; an open surface is filled only where it is narrower than this, so that no robot could be inside."""


def prisms(mesh: trimesh.Trimesh) -> list[Places] | None:
    """The corners (N, 3) m of each of the prisms that fill a mesh; None if the mesh is not extruded along an axis."""
    largest = mesh.face_normals[mesh.area_faces.argmax()]
    found = [parts for axis in (*np.eye(3)[::-1], largest) if (parts := _extrusion_prisms(mesh, axis))]
    return min(found, key=len, default=None)


def plates(mesh: trimesh.Trimesh, facets: Iterable[NDArray[np.int64]]) -> Iterator[Places]:
    """Yield the corners (N, 3) m of each plate below a mesh's facets, given as arrays of triangle indices."""
    for faces in facets:
        normal = mesh.face_normals[faces[mesh.area_faces[faces].argmax()]]
        for polygon in _merged(
            mesh.faces[faces], [mesh.vertices @ _perpendicular_axes(normal).T], mesh.vertices @ normal
        ):
            corners = mesh.vertices[polygon]
            spokes = corners - corners[0]
            up = np.cross(spokes[:-1], spokes[1:]).sum(axis=0)
            yield np.concatenate([corners, corners - THICKNESS * up / np.linalg.norm(up)])


def _extrusion_prisms(mesh: trimesh.Trimesh, axis: Direction) -> list[Places] | None:
    """The prisms of a mesh that is extruded along an axis; None if the mesh has another shape."""
    height, slope = mesh.vertices @ axis, np.abs(mesh.face_normals @ axis)
    is_high = height > (height.min() + height.max()) / 2
    number = is_high[mesh.faces].sum(axis=1)  # number of high corners of each triangle
    is_side = (number == 1) | (number == 2)
    upper, sides = mesh.faces[number == 3], mesh.faces[is_side]
    if not len(upper) or (slope[is_side] > MAX_SIDE_COSINE).any() or (slope[~is_side] < MIN_END_COSINE).any():
        return None
    if not _is_closed(upper, sides, is_high):
        return None
    below = _points_below(mesh.vertices, sides, is_high, axis)
    xy, xy_below = mesh.vertices @ _perpendicular_axes(axis).T, below @ _perpendicular_axes(axis).T
    polygons = _merged(upper, [xy, xy_below])
    if not mesh.is_watertight and any(_min_width(xy[polygon]) > MAX_OPEN_WIDTH for polygon in polygons):
        return None
    lower = np.flatnonzero(number == 0)
    beside = lower[~_is_covered(xy[mesh.faces[lower]].mean(axis=1), [xy_below[polygon] for polygon in polygons])]
    parts = [np.concatenate([mesh.vertices[polygon], below[polygon]]) for polygon in polygons]
    return [*parts, *plates(mesh, beside[:, None])]


def _is_covered(points: NDArray[np.float64], polygons: list[NDArray[np.float64]]) -> NDArray[np.bool_]:
    """(N,) bool, whether points (N, 2) lie in one of the convex polygons (K, 2) with counter-clockwise corners."""
    is_in = np.zeros(len(points), np.bool_)
    for corners in polygons if len(points) else []:
        along = np.roll(corners, -1, axis=0) - corners
        to = points[:, None] - corners
        left = along[:, 0] * to[..., 1] - along[:, 1] * to[..., 0]
        is_in |= (left >= -MAX_DEVIATION * np.linalg.norm(along, axis=1)).all(axis=1)
    return is_in


def _is_closed(ends: NDArray[np.int64], sides: NDArray[np.int64], is_high: NDArray[np.bool_]) -> bool:
    """Whether the sides adjoin all boundary edges of a prism's upper end (M, 3) and none of its inner edges."""
    edges, count = np.unique(_edges(ends), axis=0, return_counts=True)
    upper = _edges(sides)
    upper = np.unique(upper[is_high[upper].all(axis=1)], axis=0)
    return np.array_equal(edges[count == 1], upper)


def _edges(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """(3 M, 2) edges of triangles (M, 3), each with the lower index first."""
    return np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)


def _points_below(vertices: Places, sides: NDArray[np.int64], is_high: NDArray[np.bool_], axis: Direction) -> Places:
    """(N, 3) m, the point below each vertex of a mesh that is extruded along an axis.

    For the upper end of a side edge, this is the edge's lower end, unless the offset between the two ends across the
    axis exceeds ``MAX_LEAN``. For any other vertex, it is the point straight below at the mesh's lowest height along
    the axis.
    """
    height = vertices @ axis
    below = vertices - np.outer(height - height.min(), axis)
    edges = _edges(sides)
    edges = edges[is_high[edges].sum(axis=1) == 1]
    edges = np.where(is_high[edges[:, :1]], edges, edges[:, ::-1])
    aside = np.linalg.norm(below[edges[:, 0]] - below[edges[:, 1]], axis=1)
    edges = edges[np.argsort(-aside, kind="stable")]  # the nearest edge last, to overwrite other edges
    edges = edges[np.sort(-aside) >= -MAX_LEAN]
    below[edges[:, 0]] = vertices[edges[:, 1]]
    return below


def _perpendicular_axes(axis: Direction) -> NDArray[np.float64]:
    """(2, 3) two unit vectors that form a right-handed orthonormal basis with the axis."""
    x, y = np.linalg.svd(axis[None])[2][1:]
    return np.stack([x, y]) if np.cross(x, y) @ axis > 0 else np.stack([y, x])


def _min_width(corners: NDArray[np.float64]) -> float:
    """The minimum width, m, of a convex polygon (N, 2) m."""
    along = np.roll(corners, -1, axis=0) - corners
    along = along[np.linalg.norm(along, axis=1) > SLIVER]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    return float(np.ptp(corners @ normals.T, axis=0).min(initial=np.inf))


def _merged(
    triangles: NDArray[np.int64], views: list[NDArray[np.float64]], height: NDArray[np.float64] | None = None
) -> list[list[int]]:
    """Merge triangles (M, 3) into polygons that are convex in every view, and counter-clockwise in the first view.

    The method of Hertel and Mehlhorn removes each edge, longest first, if the two polygons next to it form a convex
    polygon. The result has at most four times the minimum number of polygons.

    Args:
        triangles: indices of vertices.
        views: projections of the vertices, each (N, 2) m.
        height: (N,) m, heights of the vertices; they differ by at most ``MAX_DEVIATION`` within a merged polygon.
    """
    xy, height = views[0], np.zeros(len(views[0])) if height is None else height
    a, b, c = xy[triangles].swapaxes(0, 1)
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    polygons = dict(enumerate(np.where(turn[:, None] < 0, triangles[:, ::-1], triangles).tolist()))
    low, high = height[triangles].min(axis=1).tolist(), height[triangles].max(axis=1).tolist()
    left_of = {edge: n for n, polygon in polygons.items() for edge in _polygon_edges(polygon)}
    inner = [edge for edge in left_of if edge[0] < edge[1] and edge[::-1] in left_of]
    length = np.linalg.norm(np.subtract(*xy[np.array(inner, np.int64).reshape(-1, 2).T]), axis=1)
    places = [view.tolist() for view in views]
    for start, end in (inner[n] for n in np.argsort(-length, kind="stable")):
        one, other = left_of[start, end], left_of[end, start]
        if one == other:
            continue
        if len(polygons[one]) < len(polygons[other]):
            one, other, start, end = other, one, end, start
        lowest, highest = min(low[one], low[other]), max(high[one], high[other])
        joined = _joined(polygons[one], polygons[other], start, end, places)
        if joined and highest - lowest <= MAX_DEVIATION:
            left_of |= dict.fromkeys(_polygon_edges(polygons.pop(other)), one)
            polygons[one], low[one], high[one] = joined, lowest, highest
    return list(polygons.values())


def _polygon_edges(polygon: list[int]) -> Iterator[tuple[int, int]]:
    """The edges of a polygon."""
    return zip(polygon, [*polygon[1:], polygon[0]], strict=True)


def _joined(one: list[int], other: list[int], start: int, end: int, places: list[list[list[float]]]) -> list[int]:
    """Merge two convex polygons at their common edge, which goes from ``start`` to ``end`` in the first.

    The result is empty if the merged polygon is not convex in each of the views ``places``, or if there is no such
    edge.
    """
    first, second = one.index(end), other.index(start)
    if one[first - 1] != start or other[second - 1] != end:
        return []
    joined, turn = one[first:] + one[:first] + (other[second:] + other[:second])[1:-1], len(one) - 1
    while len(joined) > 3 and joined[-1] == joined[1]:  # the outline runs back and forth along further common edges
        joined, turn = joined[1:-1], turn - 1
    while 0 < turn < len(joined) - 1 and joined[turn - 1] == joined[turn + 1]:
        del joined[turn : turn + 2]
        turn -= 1
    is_convex = all(_turns_left(place, joined, k) for place in places for k in (0, turn))
    return joined if is_convex and len(joined) > 2 else []


def _turns_left(place: list[list[float]], polygon: list[int], k: int) -> bool:
    """Whether a polygon turns to the left at its corner ``k``, within a tolerance of ``MAX_DEVIATION``."""
    (ax, ay), (x, y), (cx, cy) = (place[polygon[n % len(polygon)]] for n in (k - 1, k, k + 1))
    return (x - ax) * (cy - y) - (y - ay) * (cx - x) >= -MAX_DEVIATION * hypot(cx - ax, cy - ay)
