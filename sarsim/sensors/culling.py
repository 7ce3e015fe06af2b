"""Selection of the geoms that an image needs; without it, rendering spends most of its time on unseen vertices."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Values


def visible_geoms(model: mujoco.MjModel, data: mujoco.MjData, planes: NDArray[np.float64]) -> Mask:
    """(ngeom,) bool, the geoms that may be visible inside the view frustum, given its ``planes`` (5, 4)."""
    return np.logical_not(_outside(data.geom_xpos, _radius(model), planes).any(axis=1))


def visible_or_shadowing_geoms(model: mujoco.MjModel, data: mujoco.MjData, planes: NDArray[np.float64]) -> Mask:
    """(ngeom,) bool, the geoms that may be visible, or cast a visible shadow, inside the view frustum."""
    centre, radius = data.geom_xpos, _radius(model)
    outside = _outside(centre, radius, planes)
    needed = np.logical_not(outside.any(axis=1))
    floor = np.min(centre[:, 2] - np.where(np.isfinite(radius), radius, 0), initial=0)
    for light in np.flatnonzero(model.light_active & model.light_castshadow):
        # A shadow fills the hull of two spheres, the geom's and the shadow's end, so it is outside the view if both
        # spheres are outside one plane.
        shadow_outside = outside & _outside(*_shadow_end(model, data, int(light), floor), planes)
        needed |= np.logical_not(shadow_outside.any(axis=1))
    return needed


def shadowless_planes(model: mujoco.MjModel, data: mujoco.MjData) -> Mask:
    """(ngeom,) bool, the planes that cast no visible shadow, because they face up and no geom's centre is lower."""
    upright = data.geom_xmat[:, 8] > 1 - 1e-9
    height = data.geom_xpos[:, 2]
    return (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & upright & (height <= height.min(initial=np.inf))


def frustum(camera: mujoco.MjvGLCamera, aspect: float) -> NDArray[np.float64]:
    """(5, 4) planes (n, d) around the view frustum of a perspective camera, with n·p + d ≥ 0 inside.

    ``aspect`` is the image's width divided by its height.
    """
    forward, up = np.array(camera.forward, np.float64), np.array(camera.up, np.float64)
    right = np.cross(forward, up)
    near, bottom, top = camera.frustum_near, camera.frustum_bottom, camera.frustum_top
    half_width = camera.frustum_width or aspect * (top - bottom) / 2
    normals = np.array(
        [
            near * right + (half_width - camera.frustum_center) * forward,
            -near * right + (half_width + camera.frustum_center) * forward,
            near * up - bottom * forward,
            -near * up + top * forward,
            forward,
        ]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, -normals @ np.array(camera.pos, np.float64)])


def _radius(model: mujoco.MjModel) -> Values:
    """(ngeom,) m, radii of the bounding spheres; infinite for a plane, which has no bounding sphere in MuJoCo."""
    return np.where(model.geom_rbound > 0, model.geom_rbound, np.inf)


def _outside(
    centre: NDArray[np.float64], radius: NDArray[np.float64], planes: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(N, P) bool, whether each of N spheres lies entirely outside each of P planes."""
    return centre @ planes[:, :3].T + planes[:, 3] < -radius[:, None]


def _shadow_end(
    model: mujoco.MjModel, data: mujoco.MjData, light: int, floor: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(ngeom, 3) centres and (ngeom,) radii of the spheres in which the geoms' shadows end, on or below the floor.

    A radius is infinite if the shadow has no end, because the geom is as high as the light or the light points up.
    """
    centre, radius = data.geom_xpos, _radius(model)
    top = centre[:, 2] + radius
    if model.light_type[light] == mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
        direction = data.light_xdir[light]
        ends = np.isfinite(top) & (direction[2] < 0)
        length = np.divide(floor - top, direction[2], out=np.zeros_like(top), where=ends)
        return centre + length[:, None] * direction, np.where(ends, radius, np.inf)
    origin = data.light_xpos[light]
    ends = top < origin[2]
    scale = np.divide(origin[2] - floor, origin[2] - top, out=np.ones_like(top), where=ends)
    return origin + scale[:, None] * (centre - origin), np.where(ends, radius * scale, np.inf)
