"""The path back along the robot's own track, used if no path leads to the ground from which the robot came.

After an error of a few centimetres in the pose or in the height of a ramp, the map may show an obstacle where the
robot has just passed. The robot can drive back wherever it has driven.
"""

import numpy as np
from scipy import ndimage

from pipeline.arrays import Mask, Poses
from pipeline.planning.path_plan import PathPlan
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import yaw_of

NEAR_CELLS = 2
"""Distance to drivable ground within which a keyframe is considered to be on it, cells."""
MIN_DRIVE = 0.05
"""Distance between successive keyframes up to which the robot is considered to have only turned, m."""
MAX_DRIVE = 1.0
"""Distance between successive keyframes above which the robot is considered to have been carried, m."""


def is_cut_off(poses: Poses, paths: PosePaths) -> bool:
    """Whether paths lead to fewer than half of the keyframes, whose poses are ``poses`` (K, 4, 4)."""
    return bool(2 * np.count_nonzero(_are_reached(poses, paths)) < len(poses))


def way_back(poses: Poses, paths: PosePaths) -> PathPlan | None:
    """A plan that leads back along the track to the unreachable ground on which most keyframes were taken.

    Args:
        poses: (K, 4, 4) ``T_map_base`` of all keyframes, the newest last.
        paths: the paths from the robot's position.

    Returns:
        The plan; None if paths lead to at least half of the keyframes, or if no drivable ground is near the other
        keyframes. Also None if the robot has not driven since it left that ground, or was carried on the way.
    """
    if not is_cut_off(poses, paths):
        return None
    # Find the connected pieces of ground on which the other keyframes were taken.
    ground, places = paths.traversability, poses[:, :2, 3]
    pieces, _ = ndimage.label(ground.traversable & ~paths.reachable, np.ones((3, 3)))
    piece = ndimage.maximum_filter(pieces, 2 * NEAR_CELLS + 1)[tuple(ground.grid.cell_of(places).T)]
    piece[_are_reached(poses, paths)] = 0
    counts = np.bincount(piece)
    if not counts[1:].any():
        return None
    # Lead back to the newest keyframe on the piece with the most keyframes, with as little turning as possible.
    first = int(np.flatnonzero(piece == 1 + counts[1:].argmax())[-1])
    drives = np.diff(places[first:][::-1], axis=0)
    lengths = np.linalg.norm(drives, axis=1)
    is_drive = lengths > MIN_DRIVE
    if not is_drive.any() or lengths.max() > MAX_DRIVE:
        return None
    ends = places[-1] + np.cumsum(drives, axis=0)[is_drive]
    backwards, heading = [], yaw_of(poses[-1])
    for x, y in drives[is_drive]:
        backwards.append(bool(x * np.cos(heading) + y * np.sin(heading) < 0))
        heading = float(np.arctan2(y, x)) + np.pi * backwards[-1]
    return PathPlan(ground.on_ground(ends), np.array(backwards), [], float(lengths[is_drive].sum()))


def _are_reached(poses: Poses, paths: PosePaths) -> Mask:
    """(K,) whether a path leads to within ``NEAR_CELLS`` cells of each keyframe."""
    near = ndimage.binary_dilation(paths.reachable, np.ones((2 * NEAR_CELLS + 1, 2 * NEAR_CELLS + 1)))
    return np.asarray(near[tuple(paths.traversability.grid.cell_of(poses[:, :2, 3]).T)])
