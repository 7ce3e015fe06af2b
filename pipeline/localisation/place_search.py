"""Find the poses in a map that best explain a levelled cloud, by trying every position and heading.

Correlative scan matching (Olson, "Real-time correlative scan matching", 2009) in 3D: gravity gives roll and pitch,
and the elevation map gives the height.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Mask, Place, Places, Points, Pose, Values
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.localisation.config import RelocalisationConfig
from pipeline.localisation.relocalisation_kernels import count_values, score
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_yaw, inverse, wrap_angle, yaw_of


class VoxelState(IntEnum):
    """The state of a voxel; an occupied voxel and its neighbours are SURFACE."""

    UNKNOWN = 0
    SURFACE = 1
    FREE = 2


class VoxelField(NamedTuple):
    """The states of the map's voxels, surrounded by a border of unknown ones.

    Attributes:
        voxels: (nx, ny, nz) uint8 :class:`VoxelState`.
        lower: lower corner of the first voxel.
        size: edge length of a voxel, m.
        border: (3,) width of the border at both ends of each axis, m.
    """

    voxels: NDArray[np.uint8]
    lower: Place
    size: float
    border: NDArray[np.float64]

    @classmethod
    def around(cls, metric_map: MetricMap, points: Places) -> "VoxelField":
        """The field of the map, with a border that holds a robot's ``points`` at any position and yaw in the map."""
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

    def voxel(self, points: Places | Points) -> NDArray[np.float32]:
        """(N, 3) float32 coordinates of points in ``map``, in voxels from the field's corner."""
        return ((points - self.lower) / self.size).astype(np.float32)

    def at(self, points: Places | Points) -> NDArray[np.uint8]:
        """(N,) states at points in ``map``; UNKNOWN outside the field."""
        index = np.floor(self.voxel(points)).astype(np.int64)
        inside = ((index >= 0) & (index < self.voxels.shape)).all(axis=1)
        values = np.full(len(points), VoxelState.UNKNOWN, np.uint8)
        values[inside] = self.voxels[tuple(index[inside].T)]
        return values

    def holds(self, places: Places) -> Mask:
        """Which positions lie inside the border."""
        high = self.lower + np.array(self.voxels.shape) * self.size
        return np.asarray(((places > self.lower + self.border) & (places < high - self.border)).all(axis=1))


class Guess(NamedTuple):
    """A possible pose of the robot.

    Attributes:
        T_map_level: pose of the levelled robot.
        evidence: log-likelihood ratio of the robot's observations at this pose to those at a random pose in the map.
    """

    T_map_level: Pose
    evidence: float

    def is_near(self, T_map_level: Pose, config: RelocalisationConfig) -> bool:
        """Whether a pose is the same to within the accuracy of the search."""
        T = inverse(self.T_map_level) @ T_map_level
        return bool(np.hypot(*T[:2, 3]) < config.same_place_way and abs(yaw_of(T)) < config.same_place_turn)


def standable(elevation_map: ElevationMap, field: VoxelField, model: RobotModel) -> Places:
    """Positions on mapped ground where no surface of the map would pass through the middle of the robot."""
    elevation = elevation_map.elevation[::2, ::2]
    cells = np.argwhere(~np.isnan(elevation))
    places = np.column_stack([elevation_map.grid.centre_of(2 * cells), elevation[tuple(cells.T)]])
    places = places[field.holds(places)]
    filled = [
        field.at(places + np.array([0, 0, z])) == VoxelState.SURFACE for z in (model.body_height, model.headroom)
    ]
    return places[~np.any(filled, axis=0)]


def weigh(points: Places, places: Places, field: VoxelField, config: RelocalisationConfig) -> NDArray[np.float32]:
    """The weight of each point of a cloud as evidence, from how often random poses explain the point.

    Level ground, found almost anywhere, weighs little; a wall weighs much, and a point in unknown space nothing.

    Args:
        points: (P, 3) points relative to the levelled robot.
        places: positions where the robot may be.
        field: voxel states of the map.
        config: settings of the search.

    Returns:
        (P, 3) log-likelihood ratios of the correct pose to a random one, if the point is in UNKNOWN, SURFACE or FREE.
    """
    rng = np.random.default_rng(0)
    counts = np.zeros((len(points), 3), np.int64)
    at = field.voxel(places[rng.integers(len(places), size=config.random_poses)])
    yaws = rng.choice(headings(config), config.random_poses)
    count_values((points / field.size).astype(np.float32), at, yaws, field.voxels, counts)
    counts += 1  # Laplace's rule of succession
    _, surface, empty = counts.T
    free = empty / (empty + surface)
    gain = np.zeros(counts.shape, np.float32)
    gain[:, VoxelState.SURFACE] = np.log((1 - config.missed * free) / (1 - free))
    gain[:, VoxelState.FREE] = np.log(config.missed)
    return gain


def headings(config: RelocalisationConfig) -> Values:
    """The headings to try, rad."""
    return np.linspace(0, 2 * np.pi, config.headings, endpoint=False)


def search(
    points: Places, gain: NDArray[np.float32], places: Places, field: VoxelField, config: RelocalisationConfig
) -> list[Guess]:
    """The promising poses, the best first; none if there are too many to distinguish.

    Args:
        points: (P, 3) points relative to the levelled robot.
        gain: (P, 3) weights of the points, from :func:`weigh`.
        places: positions where the robot may be.
        field: voxel states of the map.
        config: settings of the search.
    """
    some, yaws = np.random.default_rng(0).permutation(len(points))[: config.searched], headings(config)
    scores = np.empty((len(places), len(yaws)), np.float32)
    cloud = (points[some] / field.size).astype(np.float32)
    score(cloud, gain[some], field.voxel(places), yaws, field.voxels, scores)
    least, guesses = config.promising * scores.max(), list[Guess]()
    while len(guesses) <= config.most_guesses:
        n, m = np.unravel_index(scores.argmax(), scores.shape)
        if scores[n, m] <= max(least, 0):
            return guesses
        x, y, z = places[n].tolist()
        guesses.append(Guess(from_yaw(x, y, z, yaws[m]), float(scores[n, m])))
        beside = np.hypot(*(places[:, :2] - places[n, :2]).T) < config.same_place_way
        turned = np.abs(wrap_angle(yaws - yaws[m])) < config.same_place_turn
        scores[np.ix_(beside, turned)] = -np.inf
    return []
