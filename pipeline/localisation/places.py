"""Finds the robot among surfaces seen long ago, if its position relative to them is uncertain.

All surfaces seen recently around the robot, not only the surfaces of one frame, are compared with the old surfaces at
every position and heading that the uncertainty allows (Olson, "Real-time correlative scan matching", 2009). A place
is accepted only if no other place within this range fits nearly as well.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Places, Pose, Values
from pipeline.geometry.thinning import voxel_means
from pipeline.localisation.registration import Surfaces
from pipeline.localisation.relocalisation_kernels import score
from pipeline.transforms import from_rotation, from_yaw

RADIUS = 4.0
"""Distance from the robot up to which recently seen surfaces are compared, m."""
VOXEL = 0.1
"""Edge length of the voxels in which surfaces are compared, m."""
MAX_UPRIGHT_COSINE = 0.5
"""Maximum vertical component of the normals of compared surfaces; level ground looks the same everywhere."""
PATCH_SIZE, MIN_PATCHES, MAX_PATCHES = 0.15, 80, 400
"""Size of the patches to which recently seen surfaces are thinned, m, their minimum number, and the number that is
drawn at random if there are more."""
BESIDE_SCORE = 0.5
"""Score of a patch in a voxel next to one that contains an old surface; in the latter voxel, the score is 1."""
SIGMAS = 3.0
"""Range of the search on either side of the estimate, in standard deviations of the position and the heading."""
STEP, TURN_STEP = 0.1, np.deg2rad(1.5)
"""Spacing of the positions, m, and headings, rad, that are tried. At 4 m, half a step of either moves a point by
5 cm."""
MAX_RANGE, MAX_TURN_RANGE = 5.0, np.deg2rad(20)
"""Maximum range of the search, m and rad."""
SAME_PLACE_DISTANCE, SAME_PLACE_TURN = 0.5, np.deg2rad(6)
"""Distance, m, and angle, rad, up to which two fits are of the same place."""


@dataclass(frozen=True, eq=False)
class FoundPlace:
    """The place that fits best.

    Attributes:
        T_move: correction of the robot's pose in ``map``, to be multiplied from the left.
        fit: mean score of the patches there; 1 if all lie on old surfaces.
        rival: ``fit`` of the second-best place; 0 if there is none.
    """

    T_move: Pose
    fit: float
    rival: float


def find_place(recent: Surfaces, old: Surfaces, T_map_base: Pose, sigmas: Values) -> FoundPlace | None:
    """The place where recently seen surfaces fit the old ones best; None if there are too few surfaces.

    Args:
        recent, old: surfaces in ``map``.
        T_map_base: estimated pose of the robot.
        sigmas: (3,) standard deviations of the position along x and y, m, and of the heading, rad, all relative to
            the old surfaces.
    """
    here = T_map_base[:3, 3]
    patches = voxel_means(upright_points(recent) - here, PATCH_SIZE)
    patches = patches[np.linalg.norm(patches[:, :2], axis=1) < RADIUS]
    target = upright_points(old) - here
    if len(patches) < MIN_PATCHES or len(target) < MIN_PATCHES:
        return None
    patches = np.random.default_rng(0).permutation(patches)[:MAX_PATCHES]
    # Try every position and heading that is likely enough.
    x, y = np.minimum(SIGMAS * sigmas[:2], MAX_RANGE)
    turn = min(SIGMAS * sigmas[2], MAX_TURN_RANGE)
    dx, dy = np.meshgrid(_steps_around_zero(x, STEP), _steps_around_zero(y, STEP), indexing="ij")
    moves = np.column_stack([dx.ravel(), dy.ravel(), np.zeros(dx.size)])
    yaws = _steps_around_zero(turn, TURN_STEP)
    margin = 2 * VOXEL
    reach = np.array([x, y]) + STEP + RADIUS + margin
    lower = np.append(-reach, patches[:, 2].min() - margin)
    upper = np.append(reach, patches[:, 2].max() + margin)
    field = _voxel_field(target, lower, upper)
    scores = np.empty((len(moves), len(yaws)), np.float32)
    cloud = (patches / VOXEL).astype(np.float32)
    gain = np.tile(np.array([0.0, BESIDE_SCORE, 1.0], np.float32) / len(patches), (len(patches), 1))
    score(cloud, gain, ((moves - lower) / VOXEL).astype(np.float32), yaws, field, scores)
    # The best place, and the best one elsewhere.
    n, m = np.unravel_index(scores.argmax(), scores.shape)
    far = np.linalg.norm(moves - moves[n], axis=1) > SAME_PLACE_DISTANCE
    turned = np.abs(yaws - yaws[m]) > SAME_PLACE_TURN
    rivals = scores[far[:, None] | turned]
    x, y, z = here + moves[n]
    T_move = from_yaw(x, y, z, float(yaws[m])) @ from_rotation(np.eye(3), -here)
    return FoundPlace(T_move, float(scores[n, m]), float(rivals.max()) if rivals.size else 0.0)


def upright_points(surfaces: Surfaces) -> Places:
    """The points on upright surfaces."""
    return surfaces.at[np.abs(surfaces.facing[:, 2]) < MAX_UPRIGHT_COSINE]


def _steps_around_zero(reach: float, step: float) -> Values:
    """Evenly spaced values around 0, up to ``reach`` at least."""
    count = int(np.ceil(reach / step))
    return step * np.arange(-count, count + 1.0)


def _voxel_field(points: Places, lower: Values, upper: Values) -> NDArray[np.uint8]:
    """(nx, ny, nz) uint8 voxels of a box: 2 if they contain a point, 1 if they touch a voxel that does, else 0."""
    cells = np.floor((points - lower) / VOXEL).astype(np.int64)
    shape = np.ceil((upper - lower) / VOXEL).astype(np.int64) + 2
    inside = ((cells >= 0) & (cells < shape)).all(axis=1)
    field = np.zeros(shape, np.bool_)
    field[tuple(cells[inside].T)] = True
    return field.astype(np.uint8) + ndimage.binary_dilation(field, np.ones((3, 3, 3), np.bool_))
