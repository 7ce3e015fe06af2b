"""Estimates of the vertical from the surfaces in a camera's view, for recordings without a vertical."""

from math import radians

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Mask, Planes, Pose
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.geometry.planes import ransac_plane
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.localisation.registration import front_normals
from pipeline.transforms import from_rotation, inverse, rotation_from_up

FIRST_ANGLE, LAST_ANGLE = radians(45), radians(15)
"""Maximum angle between a surface and the horizontal or vertical for it to be used, rad, in the first and in the last
rounds (values as published)."""
ROUNDS = 5
"""Number of rounds with each angle."""
MIN_SURFACE_FRACTION = 0.05
"""Minimum fraction of the surfaces that must distinguish the vertical from other directions."""

STRIDE = 6
"""Step between the rows and columns that are searched for a floor, pixels."""
MIN_POINTS = 100
"""Minimum number of returns required to find a floor."""
TRIALS = 400
"""Number of RANSAC samples of three points; if a fifth of the points lie on the floor, at least one sample lies on it
with a probability of 96%."""
FLOOR_SIGMAS = 3.0
"""Maximum distance of a point on the floor from the floor's plane, in standard deviations of the point's depth."""
MAX_FLOOR_ANGLE = radians(60)
"""Maximum angle between the floor's normal and the image's upward direction, rad."""
MIN_FLOOR_FRACTION = 0.05
"""Minimum fraction of the returns that lie on the floor."""
MAX_FRACTION_BELOW = 0.02
"""Maximum fraction of the returns that lie below the floor; more lie below a table, because the floor is below it."""
BELOW_TOLERANCES = 3.0
"""A point lies below the floor if it is lower by this many times the tolerance of ``FLOOR_SIGMAS``."""


def vertical(frame: Frame, config: LocalisationConfig = LocalisationConfig()) -> Direction | None:
    """The vertical in ``base_link``, from surfaces roughly level or upright in the image; None if undetermined.

    Floors and tables are horizontal, walls and cupboards vertical; a wall alone does not suffice. Method: S. Gupta,
    P. Arbeláez and J. Malik, "Perceptual Organization and Recognition of Indoor Scenes from RGB-D Images", CVPR 2013.
    """
    cloud = cloud_of_frame(frame, config.registration)
    if cloud is None:
        return None
    normals = front_normals(cloud, frame.T_base_camera[:3, 3])
    up = -frame.T_base_camera[:3, 1]
    for angle in np.repeat([FIRST_ANGLE, LAST_ANGLE], ROUNDS):
        along = np.abs(normals @ up)
        horizontal, upright = normals[along > np.cos(angle)], normals[along < np.sin(angle)]
        values, directions = np.linalg.eigh(upright.T @ upright - horizontal.T @ horizontal)
        if values[1] - values[0] < MIN_SURFACE_FRACTION * len(normals):
            return None
        up = directions[:, 0] * np.sign(directions[:, 0] @ up)
    return up


def T_floor_camera(frame: Frame) -> Pose:
    """Pose of ``camera_optical`` above the floor that it sees, in the frame of :func:`T_level_camera`.

    The floor is the plane with the most returns among the planes that face upward in the image and have hardly any
    returns below them.

    Raises:
        InputError: the frame shows no floor, or has too few returns.
    """
    depth, rays, shown = (image[::STRIDE, ::STRIDE] for image in (frame.depth, frame.intrinsics.rays, frame.returns))
    points = rays[shown].astype(np.float64) * depth[shown, None]
    if len(points) < MIN_POINTS:
        needed = f"at least {MIN_POINTS} to find the floor"
        raise InputError(f"the frame at {frame.time:.2f} s has only {len(points)} depths; it needs {needed}")
    tolerance = FLOOR_SIGMAS * frame.sensor.sigma(points[:, 2])

    def may_be_floor(planes: Planes, heights: NDArray[np.floating]) -> Mask:
        is_level = -planes[:, 1] > np.cos(MAX_FLOOR_ANGLE)
        return is_level & (np.mean(heights < -BELOW_TOLERANCES * tolerance[:, None], axis=0) < MAX_FRACTION_BELOW)

    triples = np.random.default_rng(0).integers(0, len(points), (TRIALS, 3))
    found = ransac_plane(points, triples, tolerance, may_be_floor)
    if found is None or np.count_nonzero(found[1]) <= MIN_FLOOR_FRACTION * len(points):
        raise InputError(f"the frame at {frame.time:.2f} s shows no floor to determine the vertical from")
    on_floor = points[found[1]]
    middle = on_floor.mean(axis=0)
    up = np.linalg.svd(on_floor - middle, full_matrices=False)[2][2]
    up *= -np.sign(up[1])
    return T_level_camera(up, float(up @ middle))


def T_lowest_camera(frame: Frame, up: Direction) -> Pose:
    """Pose of the camera above the lowest surface that it sees; ``up``: the vertical in ``camera_optical``."""
    heights = (frame.intrinsics.rays[frame.returns] @ up) * frame.depth[frame.returns]
    return T_level_camera(up, float(np.quantile(heights, MAX_FRACTION_BELOW)))


def T_level_camera(up: Direction, floor: float) -> Pose:
    """Pose of ``camera_optical`` in a level frame whose origin is on the floor below the camera.

    Its x axis points in the direction in which the camera looks.

    Args:
        up: the vertical in ``camera_optical``.
        floor: coordinate of the floor along ``up`` from the camera, m; negative.
    """
    return inverse(from_rotation(rotation_from_up(up, forward=(0.0, 0.0, 1.0)).T, floor * up))
