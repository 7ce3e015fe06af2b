"""The shapes of a model's geoms as triangles, for drawing without MuJoCo."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Points, Pose
from pipeline.transforms import from_rotation, transform_places
from sarsim.ground_truth.shapes import SQUARE, field_points, rotation, swept

SEGMENTS = 24  # Sides of a drawn circle

CREASE_COSINE = np.cos(np.deg2rad(30))  # Cosine of the angle between face normal and smoothed normal at a sharp edge

DRAWN_GROUPS = (0, 1, 2)
"""Groups of the visible geoms, as in MuJoCo's own viewer; collision geoms are in other groups."""

_DEFAULT_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""MuJoCo's default geom colour; a geom with this colour takes the colour of its material."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A coloured surface.

    Attributes:
        vertices: (N, 3) float32 m, corners of the triangles.
        normals: (N, 3) float32 outward unit normals.
        triangles: (M, 3) uint32 indices of vertices, counter-clockwise from outside.
        colours: (N, 4) uint8 RGBA colours of the vertices.
    """

    vertices: Points
    normals: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    colours: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class _Shape:
    """A mesh without colour, in float64."""

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def scaled(self, scale: NDArray[np.float64]) -> "_Shape":
        """The shape scaled along the axes by ``scale`` (3,); its normals remain perpendicular to the surface."""
        normals = self.normals / scale
        return _Shape(self.vertices * scale, normals / np.linalg.norm(normals, axis=1, keepdims=True), self.triangles)


def drawn_geoms(model: mujoco.MjModel) -> Mask:
    """(ngeom,) bool, whether each geom is visible."""
    return np.isin(model.geom_group, DRAWN_GROUPS) & (geom_colours(model)[:, 3] > 0)


def geom_poses(model: mujoco.MjModel, geoms: Iterable[int]) -> list[Pose]:
    """4×4 poses of geoms in the frames of their bodies."""
    return [from_rotation(rotation(model.geom_quat[geom]), model.geom_pos[geom]) for geom in geoms]


def true_scene(model: mujoco.MjModel, data: mujoco.MjData, robot_body: int | None = None) -> Any:
    """Open3D's RaycastingScene, m in ``world``, of an arena's visible surfaces without the robot, if there is one."""
    import open3d as o3d  # not at the top, because it takes a second

    drawn = drawn_geoms(model)
    if robot_body is not None:
        drawn &= model.body_rootid[model.geom_bodyid] != model.body_rootid[robot_body]
    geoms = np.flatnonzero(drawn)
    poses = [from_rotation(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]) for geom in geoms]
    mesh, scene = joined_mesh(model, geoms, poses), o3d.t.geometry.RaycastingScene()
    scene.add_triangles(*map(o3d.core.Tensor.from_numpy, (mesh.vertices, mesh.triangles)))
    return scene


def joined_mesh(model: mujoco.MjModel, geoms: Iterable[int], poses: Iterable[NDArray[np.float64]]) -> Mesh:
    """One mesh of several geoms, each moved by its 4×4 pose."""
    vertices, normals, triangles, colours, count = [], [], [], [], 0
    colour_of = (geom_colours(model) * 255).astype(np.uint8)
    for geom, T in zip(geoms, poses, strict=True):
        shape = _BUILDERS[mujoco.mjtGeom(model.geom_type[geom])](model, geom)
        vertices.append(transform_places(T, shape.vertices))
        normals.append(shape.normals @ T[:3, :3].T)
        triangles.append(shape.triangles + count)
        colours.append(np.tile(colour_of[geom], (len(shape.vertices), 1)))
        count += len(shape.vertices)
    return Mesh(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(triangles).astype(np.uint32),
        np.concatenate(colours),
    )


def geom_colours(model: mujoco.MjModel) -> NDArray[np.float32]:
    """(ngeom, 4) float32 RGBA in 0..1: a geom's own colour, or its material's colour times the texture's mean."""
    colours = model.geom_rgba.copy()
    takes = (model.geom_matid >= 0) & (colours == _DEFAULT_COLOUR).all(axis=1)
    for material in np.unique(model.geom_matid[takes]):
        colours[takes & (model.geom_matid == material)] = _material_colour(model, material)
    return colours


def _material_colour(model: mujoco.MjModel, material: int) -> NDArray[np.float32]:
    colour = model.mat_rgba[material].copy()
    texture = model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
    if texture >= 0:
        start, channels = model.tex_adr[texture], model.tex_nchannel[texture]
        size = model.tex_width[texture] * model.tex_height[texture] * channels
        texels = model.tex_data[start : start + size].reshape(-1, channels)
        colour[:3] *= texels[:, :3].mean(axis=0) / 255
    return colour


def _plane(model: mujoco.MjModel, geom: int) -> _Shape:
    half = model.geom_size[geom, :2]
    x, y = np.where(half > 0, half, 10 * model.stat.extent)  # 0 means infinite
    return _Shape(SQUARE * [x, y, 0], np.tile([0.0, 0, 1], (4, 1)), np.array([(0, 1, 2), (0, 2, 3)]))


def _box(model: mujoco.MjModel, geom: int) -> _Shape:
    vertices, normals = [], []
    for axis in range(3):
        u, v, n = (np.eye(3)[(axis + k) % 3] for k in (1, 2, 0))
        for side in (-1, 1):
            # Seen from outside, u × v points at the viewer on one side and away on the other.
            vertices.append(side * n + SQUARE[:, :2] @ [side * u, v])
            normals.append(np.tile(side * n, (4, 1)))
    first = np.arange(0, 24, 4)[:, None, None]
    triangles = (first + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    return _Shape(np.concatenate(vertices), np.concatenate(normals), triangles).scaled(model.geom_size[geom])


def _ball(model: mujoco.MjModel, geom: int) -> _Shape:
    """A sphere, for which MuJoCo stores only the radius, or an ellipsoid."""
    outline, size = _quarters(), model.geom_size[geom]
    return _revolved(outline, outline).scaled(np.where(size > 0, size, size[0]))


def _capsule(model: mujoco.MjModel, geom: int) -> _Shape:
    radius, half = model.geom_size[geom, :2]
    normals = _quarters()
    caps = np.repeat([-half, half], len(normals) // 2)
    return _revolved(normals * radius + np.stack([np.zeros_like(caps), caps], axis=1), normals)


def _cylinder(model: mujoco.MjModel, geom: int) -> _Shape:
    r, h = model.geom_size[geom, :2]
    outline = np.array([(0, -h), (r, -h), (r, -h), (r, h), (r, h), (0, h)])
    normals = np.array([(0, -1), (0, -1), (1, 0), (1, 0), (0, 1), (0, 1)], np.float64)
    return _revolved(outline, normals)


def _quarters() -> NDArray[np.float64]:
    """(N, 2) points (r, z) on two quarter circles: from the south pole to the equator, and on to the north pole."""
    south = np.linspace(-np.pi / 2, 0, SEGMENTS // 4 + 1)
    angle = np.concatenate([south, south + np.pi / 2])
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _revolved(outline: NDArray[np.float64], normals: NDArray[np.float64]) -> _Shape:
    """The surface that an outline of points (N, 2) m, r and z from bottom to top, sweeps around the z axis."""
    here = np.arange(SEGMENTS)
    beside = np.roll(here, -1)
    above = here + SEGMENTS
    strip = np.stack([here, beside, beside + SEGMENTS, here, beside + SEGMENTS, above], axis=1).reshape(-1, 3)
    strips = [strip + ring * SEGMENTS for ring in range(len(outline) - 1)]
    return _Shape(swept(outline, SEGMENTS), swept(normals, SEGMENTS), np.concatenate(strips))


def _mesh(model: mujoco.MjModel, geom: int) -> _Shape:
    mesh = model.geom_dataid[geom]
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    # A vertex can have a different normal in each of its faces, so every face gets its own corners.
    corner = model.mesh_vertadr[mesh] + model.mesh_face[faces]
    vertices = model.mesh_vert[corner].astype(np.float64)
    smooth = model.mesh_normal[model.mesh_normaladr[mesh] + model.mesh_facenormal[faces]]
    flat = np.cross(vertices[:, 1] - vertices[:, 0], vertices[:, 2] - vertices[:, 0])[:, None]
    flat /= np.maximum(np.linalg.norm(flat, axis=2, keepdims=True), 1e-12)
    # MuJoCo smooths even edges as sharp as a ramp's, so the smoothed normals are used only away from sharp edges.
    normals = np.where((smooth * flat).sum(axis=2, keepdims=True) > CREASE_COSINE, smooth, flat)
    triangles = np.arange(corner.size).reshape(-1, 3)
    return _Shape(vertices.reshape(-1, 3), normals.reshape(-1, 3), triangles)


def _height_field(model: mujoco.MjModel, geom: int) -> _Shape:
    points = field_points(model, geom)
    rows, columns, _ = points.shape
    along_y, along_x = np.gradient(points[..., 2], points[:, 0, 1], points[0, :, 0])
    normals = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1).reshape(-1, 3)
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    across = first + columns + 1
    triangles = np.concatenate(
        [np.stack([first, first + 1, across], axis=1), np.stack([first, across, across - 1], axis=1)]
    )
    return _Shape(points.reshape(-1, 3), normals / np.linalg.norm(normals, axis=1, keepdims=True), triangles)


_BUILDERS: dict[mujoco.mjtGeom, Callable[[mujoco.MjModel, int], _Shape]] = {
    mujoco.mjtGeom.mjGEOM_PLANE: _plane,
    mujoco.mjtGeom.mjGEOM_HFIELD: _height_field,
    mujoco.mjtGeom.mjGEOM_SPHERE: _ball,
    mujoco.mjtGeom.mjGEOM_CAPSULE: _capsule,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: _ball,
    mujoco.mjtGeom.mjGEOM_CYLINDER: _cylinder,
    mujoco.mjtGeom.mjGEOM_BOX: _box,
    mujoco.mjtGeom.mjGEOM_MESH: _mesh,
    mujoco.mjtGeom.mjGEOM_SDF: _mesh,
}
