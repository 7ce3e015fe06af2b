"""Finds a robot in its map after it was carried elsewhere; doubtful results are rejected.

Every position and heading in the map is tried, as in Olson, "Real-time correlative scan matching", 2009, but in 3D:
gravity gives roll and pitch, and the elevation map gives the height. The best poses are then registered.
"""

from enum import IntEnum
from math import radians
from typing import NamedTuple

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pipeline.arrays import Mask, Place, Places, Points, Pose, Values
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.geometry.thinning import voxel_means
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.belief import disproves
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.pose_graph import pose_sigmas
from pipeline.localisation.relocalisation_kernels import count_values, score
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation, from_yaw, inverse, transform_points, wrap_angle, yaw_of

MIN_FRAMES = 3
"""Minimum number of frames; more than one is needed because corners of rooms look alike, especially in an incomplete
map."""
PATCH_SIZE = 0.2
"""Size of a patch, m; the frames' points are thinned to patches, which are matched with the map."""
REGISTERED_VOXEL = 0.1
"""Edge length of the voxels to which the frames' points are thinned for registration, m."""
GROUND_TOLERANCE = 0.1
"""Maximum height of a pose above or below the ground, m."""
SURFACE_TOLERANCE = 0.1
"""Maximum distance from a surface of the map at which a patch lies on it, m."""
MIN_EXPLAINED = 0.85
"""Minimum fraction of the patches that lie on surfaces of the map."""
MAX_RIVAL_LIKELIHOOD = 1e-4
"""Maximum likelihood of any other place, as a fraction of the best place's."""
CORRELATED_PATCHES = 3
"""Number of patches that are treated as one observation, because neighbours fit, or fail to fit, together."""
DRIFT_SIGMA = 0.1
"""Standard deviation of the odometry's drift since the first frame, m. On a slope, a robot slides as it turns."""
MAX_POSITION_SIGMA = 0.05
"""Maximum standard deviation of the position at which a robot is found, m."""
SEARCHED_PATCHES = 256
"""Number of patches that the search uses, drawn at random; also the minimum number of points."""
HEADINGS = 72
"""Number of evenly spaced headings that are tried. At 3 m, half a step of 5° moves a point by 0.13 m, for which the
voxel on either side of a surface allows."""
RANDOM_POSES = 2000
"""Number of random poses from which a patch's probability of meeting a surface by chance is estimated."""
MISS_RATIO = 0.05
"""Probability that a patch lies in free space at the correct pose, as a fraction of the probability at a random
pose."""
MIN_PROMISING_FRACTION = 0.7
"""Minimum evidence of a guess as a fraction of the best guess's; it is below 1 because both may be off by half a
step."""
MAX_GUESSES = 12
"""Maximum number of promising guesses; with more, the place is ambiguous."""
SAME_PLACE_DISTANCE, SAME_PLACE_TURN = 0.3, radians(15)
"""Distance, m, and angle, rad, up to which two guesses are taken for one."""


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
        """The field of the map, with a border wide enough for a robot's ``points`` at any position and yaw in it."""
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

    def voxel_coordinates(self, points: Places | Points) -> NDArray[np.float32]:
        """(N, 3) float32 coordinates of points in ``map``, in voxels from the field's corner."""
        return ((points - self.lower) / self.size).astype(np.float32)

    def at(self, points: Places | Points) -> NDArray[np.uint8]:
        """(N,) states at points in ``map``; UNKNOWN outside the field."""
        index = np.floor(self.voxel_coordinates(points)).astype(np.int64)
        inside = ((index >= 0) & (index < self.voxels.shape)).all(axis=1)
        values = np.full(len(points), VoxelState.UNKNOWN, np.uint8)
        values[inside] = self.voxels[tuple(index[inside].T)]
        return values

    def holds(self, places: Places) -> Mask:
        """(N,) whether positions lie inside the border."""
        high = self.lower + np.array(self.voxels.shape) * self.size
        return np.asarray(((places > self.lower + self.border) & (places < high - self.border)).all(axis=1))


class Guess(NamedTuple):
    """A possible pose of the robot.

    Attributes:
        T_map_level: pose of the levelled robot.
        evidence: log-likelihood ratio of this pose to a random pose in the map, given the robot's observations.
    """

    T_map_level: Pose
    evidence: float

    def is_near(self, T_map_level: Pose) -> bool:
        """Whether a pose is the same to within the accuracy of the search."""
        T = inverse(self.T_map_level) @ T_map_level
        return bool(np.hypot(*T[:2, 3]) < SAME_PLACE_DISTANCE and abs(yaw_of(T)) < SAME_PLACE_TURN)


def standing_places(elevation_map: ElevationMap, field: VoxelField, model: RobotModel) -> Places:
    """(N, 3) positions on mapped ground with no surface of the map at ``body_height`` or ``headroom`` above them."""
    elevation = elevation_map.elevation[::2, ::2]
    cells = np.argwhere(~np.isnan(elevation))
    places = np.column_stack([elevation_map.grid.centre_of(2 * cells), elevation[tuple(cells.T)]])
    places = places[field.holds(places)]
    filled = [
        field.at(places + np.array([0, 0, z])) == VoxelState.SURFACE for z in (model.body_height, model.headroom)
    ]
    return places[~np.any(filled, axis=0)]


def point_gains(points: Places, places: Places, field: VoxelField) -> NDArray[np.float32]:
    """The weight of each point of a cloud as evidence, from the fraction of random poses that explain the point.

    Points on level ground, which is found almost anywhere, have little weight, points on walls have much, and points
    in unknown space have none.

    Args:
        points: (P, 3) points relative to the levelled robot.
        places: positions where the robot may be.
        field: voxel states of the map.

    Returns:
        (P, 3) log-likelihood ratios of the correct pose to a random one, if the point is in UNKNOWN, SURFACE or FREE.
    """
    rng = np.random.default_rng(0)
    counts = np.zeros((len(points), 3), np.int64)
    at = field.voxel_coordinates(places[rng.integers(len(places), size=RANDOM_POSES)])
    yaws = rng.choice(headings(), RANDOM_POSES)
    count_values((points / field.size).astype(np.float32), at, yaws, field.voxels, counts)
    counts += 1  # Laplace's rule of succession
    _, surface, empty = counts.T
    free = empty / (empty + surface)
    gain = np.zeros(counts.shape, np.float32)
    gain[:, VoxelState.SURFACE] = np.log((1 - MISS_RATIO * free) / (1 - free))
    gain[:, VoxelState.FREE] = np.log(MISS_RATIO)
    return gain


def headings() -> Values:
    """(``HEADINGS``,) the headings to try, rad."""
    return np.linspace(0, 2 * np.pi, HEADINGS, endpoint=False)


def promising_guesses(points: Places, gain: NDArray[np.float32], places: Places, field: VoxelField) -> list[Guess]:
    """The promising poses, the best first; none if there are too many to distinguish.

    Args:
        points: (P, 3) points relative to the levelled robot.
        gain: (P, 3) weights of the points, from :func:`point_gains`.
        places: positions where the robot may be.
        field: voxel states of the map.
    """
    some, yaws = np.random.default_rng(0).permutation(len(points))[:SEARCHED_PATCHES], headings()
    scores = np.empty((len(places), len(yaws)), np.float32)
    cloud = (points[some] / field.size).astype(np.float32)
    score(cloud, gain[some], field.voxel_coordinates(places), yaws, field.voxels, scores)
    least, guesses = MIN_PROMISING_FRACTION * scores.max(), list[Guess]()
    while len(guesses) <= MAX_GUESSES:
        n, m = np.unravel_index(scores.argmax(), scores.shape)
        if scores[n, m] <= max(least, 0):
            return guesses
        x, y, z = places[n].tolist()
        guesses.append(Guess(from_yaw(x, y, z, yaws[m]), float(scores[n, m])))
        beside = np.hypot(*(places[:, :2] - places[n, :2]).T) < SAME_PLACE_DISTANCE
        turned = np.abs(wrap_angle(yaws - yaws[m])) < SAME_PLACE_TURN
        scores[np.ix_(beside, turned)] = -np.inf
    return []


class MapPoints:
    """The map's points around some guesses, with which clouds are registered by GICP (Segal et al. 2009)."""

    def __init__(self, points: Points, guesses: list[Guess], reach: float, config: LocalisationConfig) -> None:
        """Keep the points within ``reach`` m of any guess along both x and y."""
        self._config = config
        near = np.zeros(len(points), np.bool_)
        for guess in guesses:
            near |= (np.abs(points[:, :2] - guess.T_map_level[:2, 3]) < reach).all(axis=1)
        self.is_empty = not near.any()
        if not self.is_empty:
            self._cloud, self._tree = self.prepared(points[near], config.registration.voxel)

    def prepared(self, points: Places | Points, size: float) -> tuple[small_gicp.PointCloud, small_gicp.KdTree]:
        """The means of points (N, 3) in voxels of ``size`` m, with their covariances, and a k-d tree of the means."""
        neighbours = self._config.registration.normal_neighbours
        return small_gicp.preprocess_points(points.astype(np.float64), size, num_neighbors=neighbours)

    def are_near(self, points: Points) -> Mask:
        """(N,) whether each of the ``points`` has a point of the map nearby."""
        _, squared = self._tree.batch_nearest_neighbor_search(points.astype(np.float64))
        return np.asarray(np.asarray(squared) < SURFACE_TOLERANCE**2)

    def align(self, cloud: small_gicp.PointCloud, T_map_level: Pose) -> Pose:
        """The registered pose of a levelled cloud; the pose is level, too."""
        for reach in (self._config.registration.coarse, self._config.registration.fine):
            T_map_level = without_tilt(self._register(cloud, T_map_level, reach).T_target_source)
        return T_map_level

    def correct(self, cloud: small_gicp.PointCloud, T_map_level: Pose) -> Pose | None:
        """Pose that fuses the registration of a cloud with a prior of the drift since the first frame.

        None if the position is too uncertain.
        """
        T, registration = T_map_level, self._config.registration
        for reach in (registration.coarse, registration.fine):
            result = self._register(cloud, T, reach)
            T = result.T_target_source
        move = inverse(T_map_level) @ T
        change = np.concatenate([Rotation.from_matrix(move[:3, :3]).as_rotvec(), move[:3, 3]])
        # Points closer together than the correspondence distance share one error.
        information = result.H * (registration.voxel / registration.fine) ** 2
        # A robot on a slope slides while it looks around.
        drift = pose_sigmas(DRIFT_SIGMA, registration.typical_range)
        drift[:2] = self._config.odometry.gravity_sigma
        covariance = np.linalg.inv(information + np.diag(drift**-2.0))
        if np.linalg.eigvalsh(covariance[3:, 3:])[-1] > MAX_POSITION_SIGMA**2:
            return None
        change = covariance @ information @ change
        return T_map_level @ from_rotation(Rotation.from_rotvec(change[:3]).as_matrix(), change[3:])

    def _register(self, cloud: small_gicp.PointCloud, T: Pose, reach: float) -> small_gicp.RegistrationResult:
        return small_gicp.align(self._cloud, cloud, self._tree, T, "GICP", max_correspondence_distance=reach)


class Relocalisation:
    """Collects frames since the robot was set down, and finds where in a map they were taken.

    Attributes:
        frames: all frames so far.
    """

    def __init__(self, model: RobotModel, *, config: LocalisationConfig = LocalisationConfig()) -> None:
        """``model``: gives the robot's size."""
        self._model, self._config = model, config
        self.frames: list[Frame] = []

    def add(self, frame: Frame) -> None:
        """Add a frame; its odometry gives its pose relative to the other frames."""
        self.frames.append(frame)

    def find(self, metric_map: MetricMap, elevation_map: ElevationMap, points: Points) -> Pose | None:
        """Find where the robot is.

        Args:
            metric_map: the map in which to find the robot.
            elevation_map: elevation map of the same area.
            points: points of the mapped surfaces.

        Returns:
            ``T_map_base`` of the newest frame; None if in doubt, because no place fits, more than one fits, or too
            little is mapped there.
        """
        registration = self._config.registration
        if len(self.frames) < MIN_FRAMES or not len(points):
            return None
        # Thin the frames' levelled points to patches, and list the positions on mapped ground where the robot may be.
        cloud = np.vstack([*map(self._points, self.frames)])
        if len(cloud) < SEARCHED_PATCHES:
            return None
        patches = voxel_means(cloud, PATCH_SIZE)
        field = VoxelField.around(metric_map, patches)
        places = standing_places(elevation_map, field, self._model)
        if not len(places):
            return None
        # Try every heading at these positions.
        gain = point_gains(patches, places, field)
        guesses = promising_guesses(patches, gain, places, field)
        target = MapPoints(points, guesses, field.border[0] + registration.coarse, self._config)
        if target.is_empty:
            return None
        # Register the promising poses; weigh each distinct one again if it is on the ground or above unknown ground.
        source, _ = target.prepared(cloud, REGISTERED_VOXEL)
        found: list[tuple[Guess, float]] = []
        for guess in guesses:
            T = target.align(source, guess.T_map_level)
            ground = elevation_map.grid.at(elevation_map.elevation, T[:2, 3], outside=np.nan)
            is_new = not any(place.is_near(T) for place, _ in found)
            if is_new and not abs(T[2, 3] - ground) > GROUND_TOLERANCE:
                moved = transform_points(T, patches)
                covered, is_unknown = target.are_near(moved), field.at(moved) == VoxelState.UNKNOWN
                empty = np.where(is_unknown, VoxelState.UNKNOWN, VoxelState.FREE)
                value = np.where(covered, VoxelState.SURFACE, empty)
                evidence = float(gain[np.arange(len(gain)), value].sum())
                found.append((Guess(T, evidence), float(covered.mean())))
        # Accept the best pose if the map covers the patches, and if it is far likelier than the others and chance.
        found.sort(key=lambda place: -place[0].evidence)
        if not found or found[0][1] < MIN_EXPLAINED:
            return None
        best, rival = found[0][0], found[1][0].evidence if len(found) > 1 else 0.0
        is_clear = (best.evidence - rival) / CORRELATED_PATCHES > -np.log(MAX_RIVAL_LIKELIHOOD)
        if not is_clear or self._contradicts(best.T_map_level, metric_map):
            return None
        return self._correct(best.T_map_level, target)

    @property
    def _T_level_odom(self) -> Pose:
        """Transform from ``odom`` to ``level``, which is the newest ``base_link`` without roll and pitch."""
        return inverse(without_tilt(self.frames[-1].T_odom_base))

    def _points(self, frame: Frame) -> Places:
        """Thinned returns of a frame in ``level``."""
        points = frame.points(self._T_level_odom @ frame.T_odom_base @ frame.T_base_camera)[::2]
        return voxel_means(points, self._config.registration.voxel)

    def _contradicts(self, T_map_level: Pose, metric_map: MetricMap) -> bool:
        """Whether the frames contradict the map if the robot is at a pose."""
        T_map_odom = T_map_level @ self._T_level_odom
        parts = (agreement(f, T_map_odom @ f.T_odom_base @ f.T_base_camera, metric_map) for f in self.frames)
        found = Agreement.of(parts)
        return disproves(found.explained, found.short + found.through, self._config.belief)

    def _correct(self, T_map_level: Pose, target: MapPoints) -> Pose | None:
        """``T_map_base`` corrected with the newest frame alone, because wheels slide while the robot looks around."""
        points = self._points(self.frames[-1])
        if len(points) < SEARCHED_PATCHES:
            return None
        cloud, _ = target.prepared(points, self._config.registration.voxel)
        corrected = target.correct(cloud, T_map_level)
        return None if corrected is None else corrected @ self._T_level_odom @ self.frames[-1].T_odom_base


def without_tilt(T: Pose) -> Pose:
    """A pose without its roll and pitch."""
    x, y, z = T[:3, 3].tolist()
    return from_yaw(x, y, z, yaw_of(T))
