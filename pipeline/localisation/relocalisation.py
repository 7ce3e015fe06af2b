"""Where in its map a robot stands that was carried there: every place is tried, and a doubtful one is refused."""

from typing import NamedTuple

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pipeline.frame import Frame
from pipeline.grid_map import Grid
from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.relocalisation_kernels import count_values, score
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation, from_yaw, inverse, transform_points, wrap_angles, yaw_of
from pipeline.traversability.elevation_map import ElevationMap

UNKNOWN, SURFACE, FREE = range(3)
"""Values of the field: what the map knows of a voxel; all that touches an occupied voxel is SURFACE."""
YAWS = np.arange(72) * 2 * np.pi / 72
"""rad, the headings that are tried: at 3 m, half a step moves a point by 0.13 m, which SURFACE allows for."""
STEP = 2
"""Cells of the elevation map from place to place: 0.1 m."""
PATCH = 0.2
"""m; what is seen is compared patch by patch of this side, of which SEARCHED, drawn at random, decide on hypotheses."""
SEARCHED = 256
SAMPLES = 2000
"""Random poses that tell how likely a patch meets a surface by chance."""
RIGHT = 0.95
"""Probability that a patch of what is known lies on a surface if the pose is right."""
HYPOTHESES = 12
"""The most that are compared; with more there is doubt."""
PROMISING = 0.7
"""Of the best hypothesis' evidence, which others need to be compared: the search is out by half a step."""
DISTINCT = 0.4, np.deg2rad(20)
"""m and rad; hypotheses nearer than both are one."""
THIN, COARSE = 0.05, 0.1
"""m, to which the map's points and a single frame, and all frames together, are thinned."""
REACH = 0.1
"""m from a point of the map within which a patch lies on its surface: a voxel."""
LEVEL = np.deg2rad(2)
"""rad; a registration that tilts the robot more is wrong, for gravity is known to 3 mrad."""
RIVAL = 1e-4
"""Probability of the best other hypothesis, compared with the accepted one, from which on there is doubt."""
CORRELATED = 3
"""Patches that are right or wrong together: a quarter of a square metre."""
COVERED = 0.85
"""Share of the patches that must lie on surfaces of the map: elsewhere it is not known well enough."""


class Field(NamedTuple):
    """What the map knows, with a border of the unknown.

    Attributes:
        voxels: (nx, ny, nz) uint8 UNKNOWN, SURFACE or FREE.
        lower: (3,) m in ``map``, where they begin.
        size: m, of a voxel.
        border: (3,) m at both ends of each axis.
    """

    voxels: NDArray[np.uint8]
    lower: NDArray[np.float64]
    size: float
    border: NDArray[np.float64]

    @classmethod
    def around(cls, metric_map: MetricMap, border: NDArray[np.float64]) -> "Field":
        """Of the whole map; (3,) m of border at both ends of each axis."""
        lower, upper = metric_map.bounds()
        cells = np.ceil(border / metric_map.voxel_size).astype(np.int64) + 2
        log_odds = metric_map.log_odds(lower - cells, upper + cells)
        surface = ndimage.maximum_filter(log_odds > 0, 3)
        voxels = np.where(surface, SURFACE, np.where(log_odds < 0, FREE, UNKNOWN)).astype(np.uint8)
        corner, size = metric_map.corner + (lower - cells) * metric_map.voxel_size, metric_map.voxel_size
        return cls(voxels, corner, size, border)

    def index(self, points: NDArray) -> NDArray[np.float32]:
        """(N, 3) float32 voxels from the field's corner of points (N, 3), m in ``map``."""
        return ((points - self.lower) / self.size).astype(np.float32)

    def at(self, points: NDArray) -> NDArray[np.uint8]:
        """(N,) values at points (N, 3), m in ``map``; UNKNOWN beyond its ends."""
        index = np.floor(self.index(points)).astype(np.int64)
        inside = ((index >= 0) & (index < self.voxels.shape)).all(axis=1)
        values = np.zeros(len(points), np.uint8)
        values[inside] = self.voxels[tuple(index[inside].T)]
        return values


class Hypothesis(NamedTuple):
    """A pose that the robot may have.

    Attributes:
        T_map_level: 4×4 pose of the levelled robot.
        evidence: log-likelihood ratio of what it sees there, to what it would see at a random place.
        covered: share of the patches that lie on surfaces of the map.
    """

    T_map_level: NDArray[np.float64]
    evidence: float
    covered: float = 0.0

    def is_near(self, other: "Hypothesis") -> bool:
        """Whether another one is the same but for the accuracy of the search."""
        T = inverse(self.T_map_level) @ other.T_map_level
        return bool(np.hypot(*T[:2, 3]) < DISTINCT[0] and abs(yaw_of(T)) < DISTINCT[1])


class Relocalisation:
    """Gathers frames, and finds where they were taken.

    Attributes:
        frames: since the robot was set down.
    """

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self.frames: list[Frame] = []

    def clear(self) -> None:
        """Forget all frames."""
        self.frames = []

    def add(self, frame: Frame) -> None:
        """Take one more frame; the odometry tells where it was taken as seen from the others."""
        self.frames.append(frame)

    def find(
        self, metric_map: MetricMap, elevation_map: ElevationMap, points: NDArray[np.float32]
    ) -> NDArray[np.float64] | None:
        """Where the robot is.

        Args:
            metric_map, elevation_map: to find it in.
            points: (N, 3) float32 of the same map, m in ``map``.

        Returns:
            4×4 ``T_map_base`` of the newest frame; None if no place fits, the map is not known well enough or there
            is doubt.
        """
        self.debug = []
        cloud = np.vstack([self._points(frame) for frame in self.frames])
        if len(cloud) < SEARCHED:
            return None
        patches = thinned(cloud, PATCH)
        border = np.full(3, np.linalg.norm(patches[:, :2], axis=1).max())
        border[2] = np.abs(patches[:, 2]).max()
        field = Field.around(metric_map, border)
        places = standable(elevation_map, field, self.model)
        if not len(places):
            return None
        gain = evidence_of(patches, places, field)
        guesses = search(patches, gain, places, field)
        self.debug = guesses
        if not guesses:
            return None
        target = MapPoints(points, guesses, border[0])
        source, _ = small_gicp.preprocess_points(cloud, COARSE, num_neighbors=10)
        found: list[Hypothesis] = []
        for guess in guesses:
            T_map_level = target.align(source, guess.T_map_level)
            hypothesis = self._judge(T_map_level, patches, gain, target, field)
            if not any(hypothesis.is_near(other) for other in found):
                found.append(hypothesis)
        self.debug = found
        best = decide(found)
        if best is None or not self._agrees(best.T_map_level, metric_map):
            return None
        return self._refine(best.T_map_level, target)

    @property
    def _T_level_odom(self) -> NDArray[np.float64]:
        T_odom_base = self.frames[-1].T_odom_base
        return inverse(from_yaw(*T_odom_base[:3, 3], yaw_of(T_odom_base)))

    def _points(self, frame: Frame) -> NDArray[np.float64]:
        """(N, 3) what a frame shows, m from the newest pose, levelled."""
        T_level_camera = self._T_level_odom @ frame.T_odom_base @ frame.T_base_camera
        return thinned(frame.points(T_level_camera)[::2].astype(np.float64), THIN)

    def _judge(self, T_map_level, patches, gain, target, field) -> Hypothesis:
        moved = transform_points(T_map_level, patches)
        on_surface = target.near(moved)
        value = np.where(on_surface, SURFACE, np.where(field.at(moved) == UNKNOWN, UNKNOWN, FREE))
        evidence = float(gain[np.arange(len(gain)), value].sum())
        return Hypothesis(T_map_level, evidence, float(on_surface.mean()))

    def _agrees(self, T_map_level: NDArray[np.float64], metric_map: MetricMap) -> bool:
        """Whether the map would not notice at once that the robot is elsewhere."""
        T_map_odom = T_map_level @ self._T_level_odom
        parts = [agreement(f, T_map_odom @ f.T_odom_base @ f.T_base_camera, metric_map) for f in self.frames]
        return not Agreement.of(parts).is_elsewhere

    def _refine(self, T_map_level, target):
        """Let the newest frame alone correct the pose, for wheels slide while a robot looks around."""
        points = self._points(self.frames[-1])
        if len(points) < SEARCHED:
            return T_map_level @ self._T_level_odom @ self.frames[-1].T_odom_base
        source, _ = small_gicp.preprocess_points(points, THIN, num_neighbors=10)
        T_map_level = target.correct(source, T_map_level)
        return T_map_level @ self._T_level_odom @ self.frames[-1].T_odom_base


def decide(found: list[Hypothesis]) -> Hypothesis | None:
    found = sorted(found, key=lambda h: -h.evidence)
    rival = found[1].evidence if len(found) > 1 else 0.0
    is_clear = found[0].evidence - rival > -CORRELATED * np.log(RIVAL)
    return found[0] if found[0].covered > COVERED and is_clear else None


class MapPoints:
    def __init__(self, points, guesses, reach):
        centres = np.array([g.T_map_level[:2, 3] for g in guesses])
        near = np.zeros(len(points), bool)
        for c in centres:
            near |= (np.abs(points[:, :2] - c) < reach + 0.5).all(axis=1)
        self.cloud, self.tree = small_gicp.preprocess_points(points[near].astype(np.float64), THIN, num_neighbors=10)

    def align(self, source, T):
        for d in (0.3, 0.1):
            T = small_gicp.align(self.cloud, source, self.tree, T, "GICP", d, 1, 10).T_target_source
            T = from_yaw(*T[:3, 3], yaw_of(T))
        return T

    def correct(self, source, T):
        T_found = T
        for d in (0.2, 0.1):
            result = small_gicp.align(self.cloud, source, self.tree, T_found, "GICP", d, 1, 20)
            T_found = result.T_target_source
        delta = inverse(T) @ T_found
        step = np.concatenate([Rotation.from_matrix(delta[:3, :3]).as_rotvec(), delta[:3, 3]])
        H = result.H / 100
        prior = np.diag(np.array([0.003, 0.003, 0.05, 0.1, 0.1, 0.03]) ** -2.0)
        step = np.linalg.solve(H + prior, H @ step)
        return T @ from_rotation(Rotation.from_rotvec(step[:3]).as_matrix(), step[3:])

    def near(self, points):
        _, d2 = self.tree.batch_nearest_neighbor_search(points.astype(np.float64))
        return np.asarray(d2) < REACH**2


def evidence_of(patches, places, field) -> NDArray[np.float32]:
    rng = np.random.default_rng(0)
    at = field.index(places[rng.integers(len(places), size=SAMPLES)])
    counts = np.zeros((len(patches), 3), np.int64)
    count_values((patches / field.size).astype(np.float32), at, rng.choice(YAWS, SAMPLES), field.voxels, counts)
    by_chance = (counts + 1) / (SAMPLES + 3)
    known = 1 - by_chance[:, UNKNOWN]
    gain = np.zeros_like(by_chance)
    gain[:, SURFACE] = np.log(RIGHT * known / by_chance[:, SURFACE])
    gain[:, FREE] = np.log((1 - RIGHT) * known / by_chance[:, FREE])
    return gain.astype(np.float32)


def search(patches, gain, places, field) -> list[Hypothesis]:
    rng = np.random.default_rng(0)
    pick = rng.permutation(len(patches))[:SEARCHED]
    scores = np.empty((len(places), len(YAWS)), np.float32)
    score((patches[pick] / field.size).astype(np.float32), gain[pick], field.index(places), YAWS, field.voxels, scores)
    result: list[Hypothesis] = []
    best = 0.0
    while len(result) < HYPOTHESES:
        n, m = np.unravel_index(scores.argmax(), scores.shape)
        if scores[n, m] <= (PROMISING * best if result else 0):
            return result
        best = max(best, scores[n, m])
        result.append(Hypothesis(from_yaw(*places[n], YAWS[m]), float(scores[n, m]) * len(patches) / len(pick)))
        beside = np.hypot(*(places[:, :2] - places[n, :2]).T) < DISTINCT[0]
        turned = np.abs(wrap_angles(YAWS - YAWS[m])) < DISTINCT[1]
        scores[np.ix_(beside, turned)] = -np.inf
    return []


def standable(elevation_map: ElevationMap, field: Field, model: RobotModel) -> NDArray[np.float64]:
    """(N, 3) places on known ground where nothing known fills the room of the robot, m in ``map``."""
    elevation = elevation_map.elevation[::STEP, ::STEP]
    cells = np.argwhere(~np.isnan(elevation))
    places = np.column_stack([elevation_map.grid.centre_of(STEP * cells), elevation[tuple(cells.T)]])
    low, high = field.lower + field.border, field.lower + np.array(field.voxels.shape) * field.size - field.border
    inside = ((places > low) & (places < high)).all(axis=1)
    places = places[inside]
    filled = [field.at(places + [0, 0, z]) == SURFACE for z in (model.body_height + 0.05, model.headroom - 0.05)]
    return places[~np.any(filled, axis=0)]


def thinned(points: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """(M, 3) means of the points (N, 3) in each voxel of a grid, m."""
    if not len(points):
        return np.zeros((0, 3))
    return np.ascontiguousarray(small_gicp.voxelgrid_sampling(points, size).points()[:, :3])
