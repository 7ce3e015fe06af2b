"""Find where in its map a robot stands after it was carried; a doubtful place is refused."""

from typing import NamedTuple

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.belief import disproves
from pipeline.localisation.motion_model import GRAVITY_SIGMA
from pipeline.localisation.place_search import SEARCHED, Guess, VoxelField, VoxelState, search, standable, weigh
from pipeline.localisation.pose_graph import spread
from pipeline.localisation.registration import CLOUD_VOXEL, COARSE, FINE, NORMAL_NEIGHBOURS
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation, from_yaw, inverse, transform_points, yaw_of

LEAST_FRAMES = 3
"""Least number of frames: one corner of a room looks like another, above all in an incomplete map."""
LEAST_EXPLAINED = 0.85
"""Least share of what was seen that lies on surfaces of the map."""
RIVAL = 1e-4
"""Greatest likelihood of any other place, relative to the best one."""
CORRELATED_PATCHES = 3
"""Number of patches that count as one: neighbours lie on a surface together, by chance or rightly."""


class RegisteredGuess(NamedTuple):
    """A registered guess; ``covered`` is the share of the patches that lie on surfaces of the map."""

    guess: Guess
    covered: float


class MapPoints:
    """The map's points around some guesses, to register clouds with by GICP (Segal et al. 2009)."""

    def __init__(self, points: NDArray[np.float32], guesses: list[Guess], reach: float) -> None:
        """Take of (N, 3) points in ``map`` those within ``reach`` m of a guess along x and y."""
        near = np.zeros(len(points), np.bool_)
        for guess in guesses:
            near |= (np.abs(points[:, :2] - guess.T_map_level[:2, 3]) < reach).all(axis=1)
        self.is_empty = not near.any()
        if not self.is_empty:
            self._cloud, self._tree = prepared(points[near], CLOUD_VOXEL)

    def are_near(self, points: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) whether a point of the map lies within a voxel of points (N, 3), m in ``map``."""
        _, squared = self._tree.batch_nearest_neighbor_search(points.astype(np.float64))
        return np.asarray(np.asarray(squared) < FINE**2)

    def align(self, cloud: small_gicp.PointCloud, T_map_level: NDArray[np.float64]) -> NDArray[np.float64]:
        """4×4 pose of a levelled cloud as registered; it stays level."""
        for reach in (COARSE, FINE):
            T = self._register(cloud, T_map_level, reach).T_target_source
            T_map_level = level(T)
        return T_map_level

    def correct(self, cloud: small_gicp.PointCloud, T_map_level: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """4×4 pose that fuses the registration of a cloud with a prior of the drift since the first frame.

        None if the position is less certain than ``CLOUD_VOXEL``.
        """
        T = T_map_level
        for reach in (COARSE, FINE):
            result = self._register(cloud, T, reach)
            T = result.T_target_source
        move = inverse(T_map_level) @ T
        change = np.concatenate([Rotation.from_matrix(move[:3, :3]).as_rotvec(), move[:3, 3]])
        # Errors of points closer than a correspondence are one error.
        information = result.H * (CLOUD_VOXEL / FINE) ** 2
        # While it looks around on a slope, a robot slides.
        drift = spread(FINE)
        drift[:2] = GRAVITY_SIGMA
        covariance = np.linalg.inv(information + np.diag(drift**-2.0))
        if np.linalg.eigvalsh(covariance[3:, 3:])[-1] > CLOUD_VOXEL**2:
            return None
        change = covariance @ information @ change
        return T_map_level @ from_rotation(Rotation.from_rotvec(change[:3]).as_matrix(), change[3:])

    def _register(
        self, cloud: small_gicp.PointCloud, T: NDArray[np.float64], reach: float
    ) -> small_gicp.RegistrationResult:
        return small_gicp.align(self._cloud, cloud, self._tree, T, "GICP", max_correspondence_distance=reach)


class Relocalisation:
    """Gathers frames since the robot was set down, and finds where in a map they were taken.

    Attributes:
        frames: all frames so far.
    """

    def __init__(self, model: RobotModel) -> None:
        """For a robot of this size."""
        self._model = model
        self.frames: list[Frame] = []

    def clear(self) -> None:
        """Forget all frames."""
        self.frames = []

    def add(self, frame: Frame) -> None:
        """Add a frame; its odometry gives its pose relative to the other frames."""
        self.frames.append(frame)

    def find(
        self, metric_map: MetricMap, elevation_map: ElevationMap, points: NDArray[np.float32]
    ) -> NDArray[np.float64] | None:
        """Find where the robot is.

        Args:
            metric_map: in which to find the robot.
            elevation_map: of the same ground.
            points: (N, 3) float32 of the same surfaces, m in ``map``.

        Returns:
            4×4 ``T_map_base`` of the newest frame; None in doubt: no place fits, more than one place fits, or the map
            knows too little there.
        """
        if len(self.frames) < LEAST_FRAMES or not len(points):
            return None
        cloud = np.vstack([*map(self._points, self.frames)])
        if len(cloud) < SEARCHED:
            return None
        patches = thinned(cloud, COARSE)
        field = VoxelField.around(metric_map, patches)
        places = standable(elevation_map, field, self._model)
        if not len(places):
            return None
        gain = weigh(patches, places, field)
        guesses = search(patches, gain, places, field)
        target = MapPoints(points, guesses, field.border[0] + COARSE)
        if target.is_empty:
            return None
        source, _ = prepared(cloud, FINE)
        found: list[RegisteredGuess] = []
        for guess in guesses:
            T_map_level = target.align(source, guess.T_map_level)
            is_new = not any(place.guess.is_near(T_map_level) for place in found)
            if is_new and stands(T_map_level, elevation_map):
                found.append(judge(T_map_level, patches, gain, target, field))
        best = decide(found)
        return None if best is None or self._contradicts(best, metric_map) else self._correct(best, target)

    @property
    def _T_level_odom(self) -> NDArray[np.float64]:
        """4×4; the frame ``level`` is the newest ``base_link`` without roll and pitch."""
        T_odom_base = self.frames[-1].T_odom_base
        return inverse(level(T_odom_base))

    def _points(self, frame: Frame) -> NDArray[np.float64]:
        """(N, 3) thinned returns of a frame in ``level``, m."""
        return thinned(frame.points(self._T_level_odom @ frame.T_odom_base @ frame.T_base_camera)[::2], CLOUD_VOXEL)

    def _contradicts(self, T_map_level: NDArray[np.float64], metric_map: MetricMap) -> bool:
        """Whether the frames contradict the map if the robot is at a 4×4 pose."""
        T_map_odom = T_map_level @ self._T_level_odom
        parts = (agreement(f, T_map_odom @ f.T_odom_base @ f.T_base_camera, metric_map) for f in self.frames)
        found = Agreement.of(parts)
        return disproves(found.explained, found.short + found.through)

    def _correct(self, T_map_level: NDArray[np.float64], target: MapPoints) -> NDArray[np.float64] | None:
        """4×4 ``T_map_base`` corrected by the newest frame alone, for wheels slide while the robot looks around."""
        points = self._points(self.frames[-1])
        if len(points) < SEARCHED:
            return None
        corrected = target.correct(prepared(points, CLOUD_VOXEL)[0], T_map_level)
        return None if corrected is None else corrected @ self._T_level_odom @ self.frames[-1].T_odom_base


def stands(T_map_level: NDArray[np.float64], elevation_map: ElevationMap) -> bool:
    """Whether a 4×4 pose is on the ground, within ``FINE`` m, or the ground there is unknown."""
    ground = elevation_map.grid.at(elevation_map.elevation, T_map_level[:2, 3], outside=np.nan)
    return not abs(T_map_level[2, 3] - ground) > FINE


def judge(
    T_map_level: NDArray[np.float64],
    patches: NDArray[np.float64],
    gain: NDArray[np.float32],
    target: MapPoints,
    field: VoxelField,
) -> RegisteredGuess:
    """How well a pose explains (P, 3) patches, m from the levelled robot; ``gain`` (P, 3) is their worth."""
    moved = transform_points(T_map_level, patches)
    covered, is_unknown = target.are_near(moved), field.at(moved) == VoxelState.UNKNOWN
    value = np.where(covered, VoxelState.SURFACE, np.where(is_unknown, VoxelState.UNKNOWN, VoxelState.FREE))
    evidence = float(gain[np.arange(len(gain)), value].sum())
    return RegisteredGuess(Guess(T_map_level, evidence), float(covered.mean()))


def decide(found: list[RegisteredGuess]) -> NDArray[np.float64] | None:
    """4×4 pose of the best place if the map covers it and it is far likelier than any other and than chance."""
    ranked = sorted(found, key=lambda place: -place.guess.evidence)
    if not ranked or ranked[0].covered < LEAST_EXPLAINED:
        return None
    rival = ranked[1].guess.evidence if len(ranked) > 1 else 0.0
    is_clear = (ranked[0].guess.evidence - rival) / CORRELATED_PATCHES > -np.log(RIVAL)
    return ranked[0].guess.T_map_level if is_clear else None


def level(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """A 4×4 pose without its roll and pitch."""
    x, y, z = T[:3, 3].tolist()
    return from_yaw(x, y, z, yaw_of(T))


def thinned(points: NDArray[np.floating], size: float) -> NDArray[np.float64]:
    """(M, 3) means of the points (N, 3) in each voxel of a grid, m."""
    if not len(points):
        return np.zeros((0, 3))
    return np.ascontiguousarray(small_gicp.voxelgrid_sampling(points.astype(np.float64), size).points()[:, :3])


def prepared(points: NDArray[np.floating], size: float) -> tuple[small_gicp.PointCloud, small_gicp.KdTree]:
    """Points (N, 3), m, thinned to voxels of ``size`` m, with their covariances, and a KD tree of them."""
    return small_gicp.preprocess_points(points.astype(np.float64), size, num_neighbors=NORMAL_NEIGHBOURS)
