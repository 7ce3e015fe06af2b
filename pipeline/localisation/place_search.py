"""Which poses in a whole map explain a levelled cloud best: every place at every heading is tried.

Correlative scan matching (Olson, "Real-time correlative scan matching", 2009) in 3D: gravity gives roll and pitch,
and the elevation map gives the height.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.localisation.localisation import KEYFRAME_TURN, KEYFRAME_WAY
from pipeline.localisation.relocalisation_kernels import count_values, score
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_yaw, inverse, wrap_angle, yaw_of

YAWS = np.linspace(0, 2 * np.pi, 72, endpoint=False)
"""rad, the headings that are tried: at 3 m, half a step moves a point by 0.13 m, which SURFACE allows for."""
SEARCHED = 256
"""Number of patches, drawn at random, that the search uses."""
RANDOM_POSES = 2000
"""Random poses from which the probability that a patch meets a surface by chance is estimated."""
MISSED = 0.05
"""Probability that a patch lies in free space at the right pose, relative to that at a random pose."""
PROMISING = 0.7
"""Share of the best guess's evidence that another guess needs to be considered: both may be off by half a step."""
MOST_GUESSES = 12
"""Greatest number of promising guesses; if there are more, the place is in doubt."""


class VoxelState(IntEnum):
    """What a voxel holds; an occupied voxel and its neighbours are SURFACE."""

    UNKNOWN = 0
    SURFACE = 1
    FREE = 2


class VoxelField(NamedTuple):
    """The states of the map's voxels, with a border of unknown ones.

    Attributes:
        voxels: (nx, ny, nz) uint8 :class:`VoxelState`.
        lower: (3,) m in ``map``, lower corner of the first voxel.
        size: side of a voxel, m.
        border: (3,) width of the border at both ends of each axis, m.
    """

    voxels: NDArray[np.uint8]
    lower: NDArray[np.float64]
    size: float
    border: NDArray[np.float64]

    @classmethod
    def around(cls, metric_map: MetricMap, points: NDArray[np.float64]) -> "VoxelField":
        """The field of the whole map, with a border that holds (N, 3) points, m, at any place and yaw in the map."""
        reach, height = np.linalg.norm(points[:, :2], axis=1).max(), np.abs(points[:, 2]).max()
        border = np.array([reach, reach, height])
        lower, upper = metric_map.bounds()
        cells = np.ceil(border / metric_map.voxel_size).astype(np.int64) + 2
        log_odds = metric_map.log_odds(lower - cells, upper + cells)
        surface = ndimage.maximum_filter(log_odds > 0, 3)
        voxels = np.where(
            surface, VoxelState.SURFACE, np.where(log_odds < 0, VoxelState.FREE, VoxelState.UNKNOWN)
        ).astype(np.uint8)
        corner, size = metric_map.corner + (lower - cells) * metric_map.voxel_size, metric_map.voxel_size
        return cls(voxels, corner, size, border)

    def voxel(self, points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, 3) float32 coordinates of points (N, 3), m in ``map``, in voxels from the field's corner."""
        return ((points - self.lower) / self.size).astype(np.float32)

    def at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """(N,) states at points (N, 3), m in ``map``; UNKNOWN beyond the field."""
        index = np.floor(self.voxel(points)).astype(np.int64)
        inside = ((index >= 0) & (index < self.voxels.shape)).all(axis=1)
        values = np.full(len(points), VoxelState.UNKNOWN, np.uint8)
        values[inside] = self.voxels[tuple(index[inside].T)]
        return values

    def holds(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether places (N, 3), m in ``map``, lie within the border."""
        high = self.lower + np.array(self.voxels.shape) * self.size
        return np.asarray(((places > self.lower + self.border) & (places < high - self.border)).all(axis=1))


class Guess(NamedTuple):
    """A pose that the robot may have.

    Attributes:
        T_map_level: 4×4 pose of the levelled robot.
        evidence: log-likelihood ratio of the robot's observations at this pose to those at a random place of the map.
    """

    T_map_level: NDArray[np.float64]
    evidence: float

    def is_near(self, T_map_level: NDArray[np.float64]) -> bool:
        """Whether a 4×4 pose is the same within the accuracy of the search."""
        T = inverse(self.T_map_level) @ T_map_level
        return bool(np.hypot(*T[:2, 3]) < KEYFRAME_WAY and abs(yaw_of(T)) < KEYFRAME_TURN)


def standable(elevation_map: ElevationMap, field: VoxelField, model: RobotModel) -> NDArray[np.float64]:
    """(N, 3) places on known ground where the map has no surface in the middle of the robot, m in ``map``."""
    elevation = elevation_map.elevation[::2, ::2]
    cells = np.argwhere(~np.isnan(elevation))
    places = np.column_stack([elevation_map.grid.centre_of(2 * cells), elevation[tuple(cells.T)]])
    places = places[field.holds(places)]
    filled = [
        field.at(places + np.array([0, 0, z])) == VoxelState.SURFACE for z in (model.body_height, model.headroom)
    ]
    return places[~np.any(filled, axis=0)]


def weigh(points: NDArray[np.float64], places: NDArray[np.float64], field: VoxelField) -> NDArray[np.float32]:
    """What each point of a cloud is worth as evidence, by how often random poses explain it.

    Level ground is found almost anywhere and is worth little, a wall is worth much, a point in unknown space nothing.

    Args:
        points: (P, 3) m from the levelled robot.
        places: (N, 3) m in ``map``, where it may stand.
        field: of the map.

    Returns:
        (P, 3) log-likelihood ratios of a right pose to a random one for UNKNOWN, SURFACE and FREE.
    """
    rng = np.random.default_rng(0)
    counts = np.zeros((len(points), 3), np.int64)
    at, yaws = field.voxel(places[rng.integers(len(places), size=RANDOM_POSES)]), rng.choice(YAWS, RANDOM_POSES)
    count_values((points / field.size).astype(np.float32), at, yaws, field.voxels, counts)
    counts += 1  # Laplace's rule of succession
    _, surface, empty = counts.T
    free = empty / (empty + surface)
    gain = np.zeros(counts.shape, np.float32)
    gain[:, VoxelState.SURFACE] = np.log((1 - MISSED * free) / (1 - free))
    gain[:, VoxelState.FREE] = np.log(MISSED)
    return gain


def search(
    points: NDArray[np.float64], gain: NDArray[np.float32], places: NDArray[np.float64], field: VoxelField
) -> list[Guess]:
    """The promising poses, the best first; none if there are too many to tell them apart.

    Args:
        points: (P, 3) m from the levelled robot.
        gain: (P, 3) as :func:`weigh` gives it.
        places: (N, 3) m in ``map``, where the robot may stand.
        field: of the map.
    """
    some = np.random.default_rng(0).permutation(len(points))[:SEARCHED]
    scores = np.empty((len(places), len(YAWS)), np.float32)
    cloud = (points[some] / field.size).astype(np.float32)
    score(cloud, gain[some], field.voxel(places), YAWS, field.voxels, scores)
    least, guesses = PROMISING * scores.max(), list[Guess]()
    while len(guesses) <= MOST_GUESSES:
        n, m = np.unravel_index(scores.argmax(), scores.shape)
        if scores[n, m] <= max(least, 0):
            return guesses
        x, y, z = places[n].tolist()
        guesses.append(Guess(from_yaw(x, y, z, YAWS[m]), float(scores[n, m])))
        beside = np.hypot(*(places[:, :2] - places[n, :2]).T) < KEYFRAME_WAY
        turned = np.abs(wrap_angle(YAWS - YAWS[m])) < KEYFRAME_TURN
        scores[np.ix_(beside, turned)] = -np.inf
    return []
