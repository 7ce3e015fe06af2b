"""Find where in its map a robot is after it was carried; doubtful results are rejected."""

from typing import NamedTuple

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Mask, Places, Points, Pose
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.geometry.thinning import voxel_means
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.belief import disproves
from pipeline.localisation.config import LocalisationConfig, RelocalisationConfig
from pipeline.localisation.place_search import Guess, VoxelField, VoxelState, search, standable, weigh
from pipeline.localisation.pose_graph import spread
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation, from_yaw, inverse, transform_points, yaw_of


class RegisteredGuess(NamedTuple):
    """A registered guess; ``covered`` is the share of the patches that lie on surfaces of the map."""

    guess: Guess
    covered: float


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
        """Points, thinned to voxels of ``size`` m, with their covariances, and a k-d tree of them."""
        neighbours = self._config.registration.normal_neighbours
        return small_gicp.preprocess_points(points.astype(np.float64), size, num_neighbors=neighbours)

    def are_near(self, points: Points) -> Mask:
        """Which of the ``points``, in ``map``, have a point of the map nearby."""
        _, squared = self._tree.batch_nearest_neighbor_search(points.astype(np.float64))
        return np.asarray(np.asarray(squared) < self._config.relocalisation.surface_tolerance**2)

    def align(self, cloud: small_gicp.PointCloud, T_map_level: Pose) -> Pose:
        """The registered pose of a levelled cloud; it stays level."""
        for reach in (self._config.registration.coarse, self._config.registration.fine):
            T_map_level = without_tilt(self._register(cloud, T_map_level, reach).T_target_source)
        return T_map_level

    def correct(self, cloud: small_gicp.PointCloud, T_map_level: Pose) -> Pose | None:
        """Pose that fuses the registration of a cloud with a prior of the drift since the first frame.

        None if the position is too uncertain.
        """
        T, registration, config = T_map_level, self._config.registration, self._config.relocalisation
        for reach in (registration.coarse, registration.fine):
            result = self._register(cloud, T, reach)
            T = result.T_target_source
        move = inverse(T_map_level) @ T
        change = np.concatenate([Rotation.from_matrix(move[:3, :3]).as_rotvec(), move[:3, 3]])
        # The errors of points closer together than a correspondence count as one error.
        information = result.H * (registration.voxel / registration.fine) ** 2
        # A robot on a slope slides while it looks around.
        drift = spread(config.drift, registration.lever)
        drift[:2] = self._config.odometry.gravity_sigma
        covariance = np.linalg.inv(information + np.diag(drift**-2.0))
        if np.linalg.eigvalsh(covariance[3:, 3:])[-1] > config.most_uncertain**2:
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

    def clear(self) -> None:
        """Forget all frames."""
        self.frames = []

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
        config, registration = self._config.relocalisation, self._config.registration
        if len(self.frames) < config.least_frames or not len(points):
            return None
        cloud = np.vstack([*map(self._points, self.frames)])
        if len(cloud) < config.searched:
            return None
        patches = voxel_means(cloud, config.patch)
        field = VoxelField.around(metric_map, patches)
        places = standable(elevation_map, field, self._model)
        if not len(places):
            return None
        gain = weigh(patches, places, field, config)
        guesses = search(patches, gain, places, field, config)
        target = MapPoints(points, guesses, field.border[0] + registration.coarse, self._config)
        if target.is_empty:
            return None
        source, _ = target.prepared(cloud, config.registered_voxel)
        found: list[RegisteredGuess] = []
        for guess in guesses:
            T_map_level = target.align(source, guess.T_map_level)
            is_new = not any(place.guess.is_near(T_map_level, config) for place in found)
            if is_new and stands(T_map_level, elevation_map, config.ground_tolerance):
                found.append(judge(T_map_level, patches, gain, target, field))
        best = decide(found, config)
        return None if best is None or self._contradicts(best, metric_map) else self._correct(best, target)

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
        T_map_odom, config = T_map_level @ self._T_level_odom, self._config.belief
        parts = (agreement(f, T_map_odom @ f.T_odom_base @ f.T_base_camera, metric_map, config) for f in self.frames)
        found = Agreement.of(parts)
        return disproves(found.explained, found.short + found.through, config)

    def _correct(self, T_map_level: Pose, target: MapPoints) -> Pose | None:
        """``T_map_base`` corrected with the newest frame alone, because wheels slide while the robot looks around."""
        points = self._points(self.frames[-1])
        if len(points) < self._config.relocalisation.searched:
            return None
        cloud, _ = target.prepared(points, self._config.registration.voxel)
        corrected = target.correct(cloud, T_map_level)
        return None if corrected is None else corrected @ self._T_level_odom @ self.frames[-1].T_odom_base


def stands(T_map_level: Pose, elevation_map: ElevationMap, tolerance: float) -> bool:
    """Whether a pose is on the ground, to within ``tolerance`` m, or the ground there is unknown."""
    ground = elevation_map.grid.at(elevation_map.elevation, T_map_level[:2, 3], outside=np.nan)
    return not abs(T_map_level[2, 3] - ground) > tolerance


def judge(
    T_map_level: Pose, patches: Places, gain: NDArray[np.float32], target: MapPoints, field: VoxelField
) -> RegisteredGuess:
    """How well a pose explains (P, 3) patches relative to the levelled robot; ``gain``: (P, 3) from :func:`weigh`."""
    moved = transform_points(T_map_level, patches)
    covered, is_unknown = target.are_near(moved), field.at(moved) == VoxelState.UNKNOWN
    value = np.where(covered, VoxelState.SURFACE, np.where(is_unknown, VoxelState.UNKNOWN, VoxelState.FREE))
    evidence = float(gain[np.arange(len(gain)), value].sum())
    return RegisteredGuess(Guess(T_map_level, evidence), float(covered.mean()))


def decide(found: list[RegisteredGuess], config: RelocalisationConfig) -> Pose | None:
    """Pose of the best guess, if the map covers it and it is far likelier than any other guess and than chance."""
    ranked = sorted(found, key=lambda place: -place.guess.evidence)
    if not ranked or ranked[0].covered < config.least_explained:
        return None
    rival = ranked[1].guess.evidence if len(ranked) > 1 else 0.0
    is_clear = (ranked[0].guess.evidence - rival) / config.correlated_patches > -np.log(config.rival)
    return ranked[0].guess.T_map_level if is_clear else None


def without_tilt(T: Pose) -> Pose:
    """A pose without its roll and pitch."""
    x, y, z = T[:3, 3].tolist()
    return from_yaw(x, y, z, yaw_of(T))
