"""Compiled ray casting for the exploration."""

import numpy as np
from numba import njit


@njit(cache=True)
def cast_ray(
    x,
    y,
    bearing,
    camera_height,
    near,
    far,
    max_slope,
    max_unknown,
    origin,
    cell,
    elevation,
    target,
    blind_from,
    blind_radius,
    seen,
):
    """What a ray of the camera at (x, y) is expected to show for the first time.

    The ray runs over the known ground; a cell is hidden where something before it rises higher in the view.
    Unknown ground is believed to go on at the last known height. Where earlier looks proved that belief wrong, a
    cell does not count: from within ``blind_radius`` (nx, ny) of ``blind_from`` (nx, ny, 2), m.

    Returns the summed radii of the target cells in view (times the step and the angle between rays that is their
    area) and their number; their flat indices go to ``seen``.
    """
    nx, ny = elevation.shape
    ground = elevation[int((x - origin[0]) / cell), int((y - origin[1]) / cell)]
    camera = ground + camera_height
    horizon = -np.inf
    unknown = 0.0
    total, count = 0.0, 0
    dx, dy = np.cos(bearing), np.sin(bearing)
    r = 0.35
    while r < far and unknown < max_unknown:
        r += cell
        i = int(np.floor((x + r * dx - origin[0]) / cell))
        j = int(np.floor((y + r * dy - origin[1]) / cell))
        if not (0 <= i < nx and 0 <= j < ny):
            break
        h = elevation[i, j]
        if np.isnan(h):
            unknown += cell
        else:
            ground = h
        slope = (ground - camera) / r
        if slope > max_slope:
            break
        if slope < horizon - 0.01:
            continue
        horizon = max(horizon, slope)
        if r >= near and target[i, j]:
            ex, ey = x - blind_from[i, j, 0], y - blind_from[i, j, 1]
            if ex * ex + ey * ey < blind_radius[i, j] ** 2:
                continue
            total += r
            seen[count] = i * ny + j
            count += 1
    return total, count


@njit(cache=True)
def view_gains(
    views,
    rays,
    rays_in_view,
    camera_height,
    near,
    far,
    max_slope,
    max_unknown,
    origin,
    cell,
    elevation,
    target,
    blind_from,
    blind_radius,
):
    """(N, rays) m² of target area expected in view from each of (N, 2) points, looking along ray m of the circle."""
    gains = np.zeros((len(views), rays))
    seen = np.zeros(int(far / cell) + 2, np.int64)
    step = 2 * np.pi / rays
    for n in range(len(views)):
        area = np.zeros(rays)
        for m in range(rays):
            total, _ = cast_ray(
                views[n, 0],
                views[n, 1],
                m * step,
                camera_height,
                near,
                far,
                max_slope,
                max_unknown,
                origin,
                cell,
                elevation,
                target,
                blind_from,
                blind_radius,
                seen,
            )
            area[m] = total * cell * step
        half = rays_in_view // 2
        for m in range(rays):
            for k in range(-half, half + 1):
                gains[n, m] += area[(m + k) % rays]
    return gains
