"""The arena as vertical columns: the convex bodies above each cell of a grid."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from pipeline.arrays import Indices, Labels, Places, Rotation3, Values
from pipeline.grid_map import Grid
from sarsim.ground_truth import columns_kernels as kernels
from sarsim.ground_truth.shapes import CUBE, SQUARE, field_triangles, hull_planes, mesh_vertices, swept
from sarsim.sensors.camera import geom_labels

INFINITE_PLANE_HALF_SIZE = 25.0  # m, half size assumed for an infinite plane that is alone
MIN_PLANE_MARGIN = 1.0  # m, minimum distance to which an infinite plane extends beyond everything else
SEGMENTS = 32  # Sides of the polygon that approximates a circle
_MERGE_GAP = 1e-3  # m; bodies with a smaller vertical gap are merged
_GEOM = mujoco.mjtGeom


@dataclass(frozen=True, eq=False)
class ConvexBodies:
    """The convex hulls of geoms in world coordinates.

    Attributes:
        planes: (M, 4) float64 planes (n, d); n·p ≤ d inside the body.
        first_plane: (N + 1,) index of each body's first plane.
        corners: (C, 2) m, corners of the bodies' outlines seen from above, counter-clockwise.
        first_corner: (N + 1,) index of each outline's first corner.
        low, high: (N, 3) float64 m, the bounding box of each body.
        label: (N,) uint8 label of each body.
    """

    planes: NDArray[np.float64]
    first_plane: NDArray[np.int64]
    corners: Places
    first_corner: NDArray[np.int64]
    low: Places
    high: Places
    label: Labels

    def windows(self, grid: Grid, margin: float = 0.0) -> NDArray[np.int64]:
        """(N, 4) cell ranges i0, i1, j0, j1 (ends excluded) of each body, extended by ``margin`` m."""
        first = np.clip(grid.cell_of(self.low[:, :2] - margin), 0, grid.shape)
        end = np.clip(grid.cell_of(self.high[:, :2] + margin) + 1, 0, grid.shape)
        return np.stack([first[:, 0], end[:, 0], first[:, 1], end[:, 1]], axis=1)


def convex_bodies(model: mujoco.MjModel, data: mujoco.MjData, robot_body: int | None) -> ConvexBodies:
    """The convex bodies of all geoms that can collide, except the robot's.

    A height field becomes one prism per triangle, and a round shape a polyhedron accurate to 0.5%.
    """
    labels = geom_labels(model)
    other = model.body_rootid[model.geom_bodyid] != (-1 if robot_body is None else robot_body)
    others = np.flatnonzero(other & ((model.geom_contype | model.geom_conaffinity) != 0))
    is_field = model.geom_type[others] == _GEOM.mjGEOM_HFIELD
    geoms, fields = others[~is_field], others[is_field]
    shapes, position = _turned_shapes(model, data, geoms), data.geom_xpos[geoms]
    planes = [
        np.column_stack([s.planes[:, :3], s.planes[:, 3] + s.planes[:, :3] @ p])
        for s, p in zip(shapes, position, strict=True)
    ]
    outlines = [s.outline + p[:2] for s, p in zip(shapes, position, strict=True)]
    prisms = [_prisms(model, data, int(field)) for field in fields]
    number = [len(p.planes) for p in prisms]
    return ConvexBodies(
        planes=np.concatenate([*planes, *(p.planes.reshape(-1, 4) for p in prisms)]),
        first_plane=_offsets([*map(len, planes), *[5] * sum(number)]),
        corners=np.concatenate([*outlines, *(p.outline.reshape(-1, 2) for p in prisms)]),
        first_corner=_offsets([*map(len, outlines), *[3] * sum(number)]),
        low=np.concatenate([position + np.reshape([s.low for s in shapes], (-1, 3)), *(p.low for p in prisms)]),
        high=np.concatenate([position + np.reshape([s.high for s in shapes], (-1, 3)), *(p.high for p in prisms)]),
        label=np.concatenate([labels[geoms], np.repeat(labels[fields], number)]),
    )


@dataclass(frozen=True, eq=False)
class Columns:
    """The bodies over each cell's centre, merged where they touch.

    Attributes:
        start, count: (nx, ny) int64, index of the first body over a cell's centre, and number of the bodies there.
        bottom, top: (N,) float64 m, lowest and highest z of each body over the cell's centre.
        normal_z: (N,) z of the surface normal at the top.
        owner: (N,) index of the convex body with this top.
    """

    start: NDArray[np.int64]
    count: NDArray[np.int64]
    bottom: Values
    top: Values
    normal_z: Values
    owner: Indices


def plane_corners(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Places:
    """(4, 3) m, the corners of a plane in its own frame, counter-clockwise from above.

    An infinite plane extends beyond all other shapes that can collide, so far that its area is at least that of an
    infinite plane without other shapes.
    """
    half = model.geom_size[geom, :2]
    low, high = np.where(half > 0, (-half, half), (0, 0) if half.all() else _infinite_plane_bounds(model, data, geom))
    return (SQUARE * [*(high - low), 0] + [*(high + low), 0]) / 2


def _infinite_plane_bounds(model: mujoco.MjModel, data: mujoco.MjData, plane: int) -> NDArray[np.float64]:
    """(2, 2) m, lowest and highest x and y of an infinite plane, in its own frame."""
    is_plane, size = model.geom_type == _GEOM.mjGEOM_PLANE, model.geom_size
    solid = (model.geom_contype | model.geom_conaffinity) != 0
    others = np.flatnonzero(solid & ~(is_plane & (size[:, :2] == 0).any(axis=1)))
    if not len(others):
        return np.array(
            [
                (-INFINITE_PLANE_HALF_SIZE, -INFINITE_PLANE_HALF_SIZE),
                (INFINITE_PLANE_HALF_SIZE, INFINITE_PLANE_HALF_SIZE),
            ]
        )
    flat = is_plane[others, None]  # MuJoCo's own boxes around planes are infinite
    middle = np.where(flat, 0, model.geom_aabb[others, :3])
    half = np.where(flat, size[others] * (1, 1, 0), model.geom_aabb[others, 3:])
    corners = middle[:, None] + half[:, None] * CUBE
    R = data.geom_xmat[others].reshape(-1, 1, 3, 3)
    places = (R @ corners[..., None])[..., 0] + data.geom_xpos[others, None] - data.geom_xpos[plane]
    xy = (places @ data.geom_xmat[plane].reshape(3, 3))[..., :2].reshape(-1, 2)
    low, high = xy.min(axis=0), xy.max(axis=0)
    # The solution of (a + 2 beyond) · (b + 2 beyond) = (2 INFINITE_PLANE_HALF_SIZE)² for sides a and b
    a, b = high - low
    beyond = max(MIN_PLANE_MARGIN, (np.hypot(a - b, 4 * INFINITE_PLANE_HALF_SIZE) - a - b) / 4)
    return np.array([low - beyond, high + beyond])


def columns(bodies: ConvexBodies, grid: Grid) -> Columns:
    """The columns of bodies over the cells of a grid."""
    windows = bodies.windows(grid)
    count = np.zeros(grid.shape, np.int64)
    kernels.count_bodies(bodies.planes, bodies.first_plane, windows, grid.origin, grid.cell, count)
    start = np.cumsum(count.ravel()).reshape(count.shape) - count
    total = int(count.sum())
    arrays = (np.empty(total), np.empty(total), np.empty(total), np.empty(total, np.int64))
    kernels.fill_bodies(bodies.planes, bodies.first_plane, windows, grid.origin, grid.cell, start.copy(), *arrays)
    kernels.merge_bodies(start, count, *arrays, _MERGE_GAP)
    return Columns(start, count, *arrays)


_Shape = tuple[NDArray[np.float64], NDArray[np.float64]]
"""A convex body in its geom's frame: (M, 4) planes and (N, 3) vertices."""


@dataclass(frozen=True, eq=False)
class _TurnedShape:
    """A convex body relative to its geom's position, with the axes of the world.

    Attributes:
        planes: (M, 4) planes (n, d); n·p ≤ d inside the body.
        outline: (N, 2) m, corners of the outline seen from above, counter-clockwise.
        low, high: (3,) m, lowest and highest corner of the bounding box.
    """

    planes: NDArray[np.float64]
    outline: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def _turned_shapes(model: mujoco.MjModel, data: mujoco.MjData, geoms: Indices) -> list[_TurnedShape]:
    """The shape of each geom; an arena repeats few combinations of shape and rotation, so each is computed once."""
    # Where an infinite plane ends depends on its position.
    is_plane = (model.geom_type[geoms] == _GEOM.mjGEOM_PLANE)[:, None]
    kinds = [
        model.geom_type[geoms], model.geom_dataid[geoms], model.geom_size[geoms], data.geom_xmat[geoms],
        np.where(is_plane, data.geom_xpos[geoms], 0),
    ]  # fmt: skip
    _, first, which = np.unique(np.column_stack(kinds), axis=0, return_index=True, return_inverse=True)
    turned = [_turned(*_shape(model, data, int(g)), data.geom_xmat[g].reshape(3, 3)) for g in geoms[first]]
    return [turned[k] for k in which.ravel()]


def _turned(planes: NDArray[np.float64], vertices: NDArray[np.float64], R: Rotation3) -> _TurnedShape:
    planes, vertices = np.column_stack([planes[:, :3] @ R.T, planes[:, 3]]), vertices @ R.T
    return _TurnedShape(planes, _outline(vertices[:, :2]), vertices.min(axis=0), vertices.max(axis=0))


def _prisms(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> _TurnedShape:
    """The prisms below the N triangles of a height field, in world coordinates.

    The prisms are stacked: ``planes`` is (N, 5, 4), ``outline`` is (N, 3, 2), and ``low`` and ``high`` are (N, 3).
    """
    tops, R, position = field_triangles(model, geom), data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    feet = (tops * (1, 1, 0) - (0, 0, model.hfield_size[model.geom_dataid[geom], 3])) @ R.T
    tops = tops @ R.T
    sides = (np.stack([feet[:, a], feet[:, b], tops[:, a]], axis=1) for a, b in ((0, 1), (1, 2), (2, 0)))
    planes = np.empty((len(tops), 5, 4))
    for k, face in enumerate(chain([tops], sides, [feet[:, ::-1]])):  # one by one, because fields may be large
        normal = np.cross(face[:, 1] - face[:, 0], face[:, 2] - face[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        planes[:, k, :3], planes[:, k, 3] = normal, (normal * face[:, 0]).sum(axis=1) + normal @ position
    low = np.minimum(tops.min(axis=1), feet.min(axis=1))
    high = np.maximum(tops.max(axis=1), feet.max(axis=1))
    return _TurnedShape(planes, tops[:, :, :2] + position[:2], low + position, high + position)


def _outline(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) convex hull of points, counter-clockwise; two end points if all points are on a line."""
    try:
        return xy[ConvexHull(xy).vertices]
    except QhullError:
        order = np.lexsort(xy.T)
        return xy[order[[0, -1]]]


def _offsets(lengths: list[int]) -> NDArray[np.int64]:
    return np.cumsum([0, *lengths])


def _shape(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> _Shape:
    kind, size = _GEOM(model.geom_type[geom]), model.geom_size[geom]
    if kind == _GEOM.mjGEOM_PLANE:
        return _plane(plane_corners(model, data, geom))
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF):
        return _hull(mesh_vertices(model, geom))
    if kind in _ROUND:
        return _hull(_ROUND[kind](size))
    return _box(model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:])


def _plane(corners: NDArray[np.float64]) -> _Shape:
    """The prism below a rectangle, unbounded downwards; ``corners``: (4, 3) m, as of :func:`plane_corners`."""
    normals = np.array([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], np.float64)
    return np.column_stack([normals, (corners @ normals.T).max(axis=0)]), corners


def _box(centre: NDArray[np.float64], half: NDArray[np.float64]) -> _Shape:
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    return np.column_stack([normals, np.tile(half, 2) + normals @ centre]), centre + CUBE * half


def _hull(vertices: NDArray[np.float64]) -> _Shape:
    return hull_planes(vertices), vertices


def _cylinder(size: NDArray[np.float64]) -> NDArray[np.float64]:
    radius, half = size[:2]
    return swept(np.array([(radius, -half), (radius, half)]), SEGMENTS)


def _capsule(size: NDArray[np.float64]) -> NDArray[np.float64]:
    end = np.array([0, 0, size[1]])
    return np.concatenate([_ball() * size[0] - end, _ball() * size[0] + end])


def _ball() -> NDArray[np.float64]:
    """(N, 3) points on the unit sphere."""
    latitudes = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)[1:-1]
    rings = swept(np.stack([np.cos(latitudes), np.sin(latitudes)], axis=1), SEGMENTS)
    return np.concatenate([rings, [(0, 0, -1), (0, 0, 1)]])


_ROUND: dict[mujoco.mjtGeom, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    _GEOM.mjGEOM_CYLINDER: _cylinder,
    _GEOM.mjGEOM_CAPSULE: _capsule,
    _GEOM.mjGEOM_SPHERE: lambda size: _ball() * size[0],
    _GEOM.mjGEOM_ELLIPSOID: lambda size: _ball() * size,
}
"""For each round geom type, the function that returns (N, 3) points on its surface."""
