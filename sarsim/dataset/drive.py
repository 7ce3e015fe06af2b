"""Drives through an arena: the robot's poses at the keyframes, tilted according to the ground under its wheels."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose
from pipeline.elevation_map.config import TraversabilityConfig
from pipeline.elevation_map.traversability import Traversability, assess
from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.planning.pose_paths import PosePaths, simplify
from pipeline.transforms import from_rotation, from_yaw, inverse, wrap_angle, yaw_of
from sarsim.dataset import wheel_contact_kernels as kernels
from sarsim.dataset.settings import KEYFRAME_SPACING
from sarsim.ground_truth.columns import ConvexBodies
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.robots.model import robot_model
from sarsim.robots.pose import TrajectorySample
from sarsim.sensors.inertial import GRAVITY
from sarsim.sensors.odometry import WheelOdometry, acceleration_of

SPEED, TURN_RATE = 0.2, 0.6
"""Speed (m/s) and turn rate (rad/s) of the drive."""
PERIOD = 0.3
"""Time between two poses of the drive, s."""
TILT_VIBRATION, HEIGHT_VIBRATION = 0.003, 0.001
"""Standard deviations of roll and pitch (rad), and of height (m), that vibration causes at a keyframe."""
GOAL_CANDIDATES = 12
"""Number of random goals drawn for a leg; the robot drives to the goal farthest from all visited places."""
MAX_FAILURES = 50
"""Maximum number of consecutive legs without a keyframe."""
WHEEL_RADIUS = 0.1105
"""Wheel radius, m; any value would do, because the wheel angles are computed from it as well."""
WHEEL_CENTRES = np.array(
    [(0.135, 0.199, 0.111), (0.135, -0.199, 0.111), (-0.135, 0.199, 0.111), (-0.135, -0.199, 0.111)]
)
"""(4, 3) centres of a P3-AT's wheels in ``base_link``, m: front left, front right, rear left, rear right."""
LOADED_RADIUS = 0.110  # m, a P3-AT's tyre, whose radius of 0.111 m the robot's weight reduces by 1 mm
CENTRE_OF_MASS = np.array([0.005, 0.0, 0.149])  # (3,) m in ``base_link``
UNDERSIDE = np.array([(x, y, 0.08) for x in (-0.2, -0.1, 0.0, 0.1, 0.2) for y in (-0.1, 0.0, 0.1)])
"""(N, 3) lowest points of the chassis in ``base_link``, m."""
MAX_GROUND_OFFSET = 0.2  # m; a surface farther than this above the ground at the robot's centre is not ground


class WheelContact:
    """The contact of the robot's wheels with the ground of an arena."""

    def __init__(self, bodies: ConvexBodies, grid: Grid):
        """Index ``bodies``, the arena without the robot, by the cells of ``grid`` over which they lie."""
        number = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape)
        cells = [number[i0:i1, j0:j1].ravel() for i0, i1, j0, j1 in bodies.windows(grid)]
        cell, body = np.concatenate(cells), np.repeat(np.arange(len(cells)), [len(c) for c in cells])
        count = np.bincount(cell, minlength=number.size).reshape(grid.shape)
        start = count.cumsum().reshape(grid.shape) - count
        listed = body[np.argsort(cell, kind="stable")]
        self._ground = kernels.Ground(bodies.planes, bodies.first_plane, start, count, listed, grid.origin, grid.cell)

    def rest_pose(self, x: float, y: float, yaw: float, height: float) -> Pose | None:
        """Pose of ``base_link`` at rest at (x, y), m, with heading ``yaw``, rad, on rigid tyres.

        None if the robot cannot stand: a wheel has no ground below it, or the chassis would touch the ground.
        ``height``: height of the ground near (x, y), m.
        """
        below = height + MAX_GROUND_OFFSET
        z, climb, rise = kernels.rest_pose(
            self._ground, x, y, yaw, below, WHEEL_CENTRES, LOADED_RADIUS, CENTRE_OF_MASS
        )
        if not np.isfinite(z):
            return None
        R = kernels.attitude(yaw, climb, rise)
        if not kernels.is_clear(self._ground, x, y, z, R, below, UNDERSIDE):
            return None
        return from_rotation(R, (x, y, z))


class EndlessDrive:
    """An endless drive of a robot, leg by leg, to places far from all visited ones."""

    def __init__(
        self,
        surface: GroundTruthSurface,
        wheel_contact: WheelContact,
        T_world_start: NDArray[np.float64],
        rng: np.random.Generator,
        keyframes: tuple[float, float] = KEYFRAME_SPACING,
        frames_per_second: float | None = None,
    ):
        """Start at ``T_world_start``, a 4×4 pose of ``base_link`` on drivable ground.

        ``keyframes``: distance, m, or turn, rad, after which the next keyframe is taken. With ``frames_per_second``,
        keyframes are taken at this rate instead, whether or not the robot has moved.
        """
        self._distance, self._turn_angle = (0.0, 0.0) if frames_per_second else keyframes
        self._period = 1 / frames_per_second if frames_per_second else PERIOD
        self._surface = surface
        self._contact = wheel_contact
        self._rng = rng
        self._roads = _roads(surface)
        self._at = np.array([*T_world_start[:2, 3], yaw_of(T_world_start)])
        self._dead_reckoning = DeadReckoning(rng, self._period)
        self._time = 0.0

    def poses(self, count: int) -> list[TrajectorySample]:
        """The poses of the first ``count`` keyframes.

        Raises:
            InputError: the robot cannot stand at the start, or cannot leave it.
        """
        found: list[TrajectorySample] = []
        failures = 0
        while len(found) < count:
            before = len(found)
            self._follow(self._leg([s.T_world_base[:2, 3] for s in found]), found)
            failures = 0 if len(found) > before else failures + 1
            if failures > MAX_FAILURES:
                x, y = self._at[:2]
                raise InputError(
                    f"the robot can neither turn nor drive at ({x:.2f}, {y:.2f}) m; use an arena with more room"
                )
        return found[:count]

    def _follow(self, leg: NDArray[np.float64], found: list[TrajectorySample]) -> None:
        """Drive a leg, (K, 3) x, y and yaw, m and rad, until the robot cannot stand; add keyframes to ``found``."""
        for x, y, yaw in leg:
            height = self._surface.grid.at(self._surface.height, np.array([x, y]), outside=np.nan)
            T = self._contact.rest_pose(x, y, yaw, float(height))
            if T is None:
                return
            self._at = np.array([x, y, yaw])
            T_odom = self._dead_reckoning.update(T)
            if not found or self._is_due(found[-1].T_world_base):
                found.append(TrajectorySample(self._time, T @ self._vibration(), T_odom))
            self._time = round(self._time + self._period, 6)

    def _is_due(self, last: NDArray[np.float64]) -> bool:
        """Whether the robot has moved or turned far enough for another keyframe."""
        moved = np.linalg.norm(self._at[:2] - last[:2, 3])
        turned = abs(wrap_angle(self._at[2] - yaw_of(last)))
        return bool(moved >= self._distance or turned >= self._turn_angle)

    def _vibration(self) -> NDArray[np.float64]:
        """A random 4×4 offset from the robot's pose at rest, caused by vibration."""
        roll, pitch = TILT_VIBRATION * self._rng.standard_normal(2)
        height = HEIGHT_VIBRATION * self._rng.standard_normal()
        return from_rotation(Rotation.from_euler("xyz", [roll, pitch, 0]).as_matrix(), (0, 0, height))

    def _leg(self, visited: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(K, 3) x, y and yaw, m and rad, one row per period: a path to another place, then a turn in place."""
        path = self._path(visited)
        parts, yaw = [self._at[None]], float(self._at[2])
        for a, b in pairwise(path):
            heading = float(np.arctan2(*(b - a)[::-1]))
            parts += [self._turn(a, yaw, heading), self._straight(a, b, heading)]
            yaw = heading
        parts.append(self._turn(path[-1], yaw, self._rng.uniform(-np.pi, np.pi)))
        return np.concatenate(parts)

    def _path(self, visited: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(K, 2) m, corners of the path to the candidate goal that is farthest from the visited places."""
        here = self._at[:2]
        paths = PosePaths(self._roads, here)
        # A leg ends with a turn, and a robot does not turn on a ramp.
        cells = np.argwhere(paths.reachable & self._roads.turnable)
        if paths.start is None or not len(cells):
            return here[None]
        places = self._roads.grid.centre_of(cells[self._rng.integers(len(cells), size=GOAL_CANDIDATES)])
        been = np.array([here, *visited])
        nearest = np.linalg.norm(places[:, None] - been, axis=2).min(axis=1)
        path = simplify(paths.path_to(places[nearest.argmax()]), self._roads)
        # The path begins at the centre of the robot's cell or of the nearest free cell, not at the robot's position.
        return np.concatenate([here[None], path[1:]])

    def _turn(self, at: NDArray[np.float64], yaw: float, heading: float) -> NDArray[np.float64]:
        """(K, 3) x, y and yaw, m and rad, of the shorter turn in place from ``yaw`` to ``heading``."""
        angle = wrap_angle(heading - yaw)
        steps = int(np.ceil(abs(angle) / (TURN_RATE * self._period)))
        share = np.arange(1, steps + 1) / max(steps, 1)
        return np.column_stack([np.tile(at, (steps, 1)), yaw + share * angle])

    def _straight(self, a: NDArray[np.float64], b: NDArray[np.float64], heading: float) -> NDArray[np.float64]:
        """(K, 3) x, y and yaw, m and rad, on the straight line from ``a`` to ``b``, each (2,) m."""
        steps = int(np.ceil(np.linalg.norm(b - a) / (SPEED * self._period)))
        share = np.arange(1, steps + 1)[:, None] / max(steps, 1)
        return np.column_stack([a + share * (b - a), np.full(steps, heading)])


class DeadReckoning:
    """The wheel odometry of a robot that is moved from pose to pose without physics."""

    def __init__(self, rng: np.random.Generator, period: float):
        """Begin at the first pose; ``rng`` draws the odometry's errors; ``period`` is the time between poses, s."""
        self._odometry = WheelOdometry(rng, WHEEL_RADIUS)
        self._period = period
        self._angle = self._speed = 0.0
        self._last: NDArray[np.float64] | None = None
        self._T_world_odom = np.eye(4)

    def update(self, T_world_base: NDArray[np.float64]) -> NDArray[np.float64]:
        """The dead-reckoned 4×4 pose in the world after a move to ``T_world_base``; the first pose is exact."""
        R, gyro, speed = T_world_base[:3, :3], np.zeros(3), 0.0
        if self._last is None:
            x, y, z = T_world_base[:3, 3]
            self._T_world_odom = from_yaw(x, y, z, yaw_of(T_world_base))
        else:
            move = inverse(self._last) @ T_world_base
            self._angle += move[0, 3] / WHEEL_RADIUS
            gyro, speed = Rotation.from_matrix(move[:3, :3]).as_rotvec() / self._period, move[0, 3] / self._period
        accelerometer = R[2] * GRAVITY + acceleration_of(self._speed, speed, gyro, self._period)
        self._last, self._speed = T_world_base, speed
        wheels = np.array([self._angle, self._angle])
        return self._T_world_odom @ self._odometry.update(wheels, gyro, accelerometer, self._period)


def _roads(surface: GroundTruthSurface) -> Traversability:
    """The true ground in the representation of the robot's planner, which takes ramps head-on."""
    nowhere = np.zeros(surface.grid.shape, np.bool_)
    elevation, driven = surface.height.astype(np.float32), nowhere.astype(np.uint16)
    roads = assess(surface.grid, elevation, nowhere, driven, robot_model(), TraversabilityConfig())
    return replace(roads, required_clearance=np.where(surface.drivable, roads.required_clearance, np.int8(127)))
