"""Drives through an arena: where the robot is, leaning as the ground under its wheels makes it, at each look."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.errors import InputError
from pipeline.transforms import from_rotation, from_yaw, inverse, wrap_angle, yaw_of
from pipeline.traversability.shortest_paths import ShortestPaths, simplify
from pipeline.traversability.traversability import Traversability, assess
from sarsim.dataset.wheel_contact import WheelContact
from sarsim.ground_truth.true_surface import TrueSurface
from sarsim.robots.pioneer3at import MODEL
from sarsim.robots.pose import Pose
from sarsim.sensors.odometry import OdometryConfig, WheelOdometry

GRAVITY = np.array([0.0, 0.0, 9.81])
CANDIDATES = 12
"""Places of which the one farthest from where the robot has been is driven to."""
MAX_FAILURES = 50
"""Drives in a row that bring no look."""


@dataclass(frozen=True)
class DriveConfig:
    """How the robot drives and when it looks.

    Attributes:
        speed: m/s.
        turn_rate: rad/s.
        period: s between two poses of the drive.
        look_distance: m between looks.
        look_turn: rad between looks.
        tilt_vibration: rad, standard deviation of roll and pitch at a look.
        height_vibration: m, standard deviation of the height at a look.
    """

    speed: float = 0.2
    turn_rate: float = 0.6
    period: float = 0.3
    look_distance: float = 0.3
    look_turn: float = 0.6
    tilt_vibration: float = 0.003
    height_vibration: float = 0.001

    def __post_init__(self) -> None:
        for name, (low, high) in _LIMITS.items():
            if not low <= getattr(self, name) <= high:
                flag = f"--drive.{name.replace('_', '-')} {getattr(self, name):g}"
                raise InputError(f"{flag}: from {low:g} to {high:g}")


_LIMITS = {
    "speed": (0.01, 2.0),
    "turn_rate": (0.01, 6.0),
    "period": (0.01, 2.0),
    "look_distance": (0.01, 10.0),
    "look_turn": (0.01, 6.3),
    "tilt_vibration": (0.0, 0.2),
    "height_vibration": (0.0, 0.1),
}


class Drive:
    """A drive of a robot that goes on and on to places where it has not been."""

    def __init__(
        self,
        surface: TrueSurface,
        wheel_contact: WheelContact,
        T_world_start: NDArray[np.float64],
        config: DriveConfig,
        rng: np.random.Generator,
    ):
        """``T_world_start``: 4×4 pose of ``base_link`` on drivable ground."""
        self.config = config
        self._surface = surface
        self._footing = wheel_contact
        self._rng = rng
        self._roads = _roads(surface)
        self._at = np.array([*T_world_start[:2, 3], yaw_of(T_world_start)])
        self._dead_reckoning = DeadReckoning(rng, config.period)
        self._time = 0.0

    def poses(self, count: int) -> list[Pose]:
        """Where the robot is at each of the first so many looks.

        Raises:
            InputError: the robot cannot stand at the start, or is locked in.
        """
        found: list[Pose] = []
        failures = 0
        while len(found) < count:
            before = len(found)
            self._follow(self._leg([s.T_world_base[:2, 3] for s in found]), found)
            failures = 0 if len(found) > before else failures + 1
            if failures > MAX_FAILURES:
                x, y = self._at[:2]
                raise InputError(f"the robot can neither turn nor drive at ({x:.2f}, {y:.2f}) m")
        return found[:count]

    def _follow(self, leg: NDArray[np.float64], found: list[Pose]) -> None:
        """Drive along a leg, (K, 3) of x, y, yaw, as far as the robot can stand; add its pose at each look."""
        for x, y, yaw in leg:
            T = self._footing.stand(x, y, yaw, self._height(x, y))
            if T is None:
                return
            self._at = np.array([x, y, yaw])
            T_odom = self._dead_reckoning.update(T)
            if not found or self._is_due(found[-1].T_world_base):
                found.append(Pose(self._time, T @ self._vibration(), T_odom))
            self._time = round(self._time + self.config.period, 6)

    def _height(self, x: float, y: float) -> float:
        return float(self._surface.grid.at(self._surface.height, np.array([x, y]), outside=np.nan))

    def _is_due(self, last: NDArray[np.float64]) -> bool:
        """Whether the robot has come far enough for another look."""
        moved = np.linalg.norm(self._at[:2] - last[:2, 3])
        turned = abs(wrap_angle(self._at[2] - yaw_of(last)))
        return bool(moved >= self.config.look_distance or turned >= self.config.look_turn)

    def _vibration(self) -> NDArray[np.float64]:
        """4×4 how a shaking robot leans off its place of rest."""
        roll, pitch = self.config.tilt_vibration * self._rng.standard_normal(2)
        height = self.config.height_vibration * self._rng.standard_normal()
        return from_rotation(Rotation.from_euler("xyz", [roll, pitch, 0]).as_matrix(), (0, 0, height))

    def _leg(self, visited: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(K, 3) x, y, yaw a period apart: to another place, and a turn there."""
        path = self._path(visited)
        parts, yaw = [self._at[None]], float(self._at[2])
        for a, b in pairwise(path):
            heading = float(np.arctan2(*(b - a)[::-1]))
            parts += [self._turn(a, yaw, heading), self._straight(a, b, heading)]
            yaw = heading
        parts.append(self._turn(path[-1], yaw, self._rng.uniform(-np.pi, np.pi)))
        return np.concatenate(parts)

    def _path(self, visited: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """(K, 2) corners of the way to the candidate that is farthest from the places visited."""
        here = self._at[:2]
        paths = ShortestPaths(self._roads, here)
        # On a ramp no robot turns, so it does not end there.
        cells = np.argwhere(paths.reachable & self._roads.turnable)
        if paths.start is None or not len(cells):
            return here[None]
        places = self._roads.grid.centre_of(cells[self._rng.integers(len(cells), size=CANDIDATES)])
        been = np.array([here, *visited])
        nearest = np.linalg.norm(places[:, None] - been, axis=2).min(axis=1)
        path = simplify(self._roads, paths.path_to(places[nearest.argmax()]))
        # The path begins in the middle of the robot's cell, or of the nearest one that is free.
        return np.concatenate([here[None], path[1:]])

    def _turn(self, at: NDArray[np.float64], yaw: float, heading: float) -> NDArray[np.float64]:
        """(K, 3) the shorter way from one heading to another."""
        angle = wrap_angle(heading - yaw)
        steps = int(np.ceil(abs(angle) / (self.config.turn_rate * self.config.period)))
        share = np.arange(1, steps + 1) / max(steps, 1)
        return np.column_stack([np.tile(at, (steps, 1)), yaw + share * angle])

    def _straight(
        self, a: NDArray[np.float64], b: NDArray[np.float64], heading: float
    ) -> NDArray[np.float64]:
        """(K, 3) from one place to another."""
        steps = int(np.ceil(np.linalg.norm(b - a) / (self.config.speed * self.config.period)))
        share = np.arange(1, steps + 1)[:, None] / max(steps, 1)
        return np.column_stack([a + share * (b - a), np.full(steps, heading)])


class DeadReckoning:
    """The wheel odometry of a robot that is moved from pose to pose."""

    def __init__(self, rng: np.random.Generator, period: float, config: OdometryConfig | None = None):
        """``rng`` draws its errors; ``period`` s from pose to pose."""
        self._odometry = WheelOdometry(rng, config)
        self._period = period
        self._angle = 0.0
        self._last: NDArray[np.float64] | None = None
        self._T_world_odom = np.eye(4)

    def update(self, T_world_base: NDArray[np.float64]) -> NDArray[np.float64]:
        """4×4 pose in the world that the robot believes to have after a move; where it begins it knows."""
        R, gyro = T_world_base[:3, :3], np.zeros(3)
        if self._last is None:
            x, y, z = T_world_base[:3, 3]
            self._T_world_odom = from_yaw(x, y, z, yaw_of(T_world_base))
        else:
            move = inverse(self._last) @ T_world_base
            self._angle += move[0, 3] / self._odometry.config.wheel_radius
            gyro = rotation_vector(move[:3, :3]) / self._period
        self._last = T_world_base
        wheels = np.array([self._angle, self._angle])
        return self._T_world_odom @ self._odometry.update(wheels, gyro, R.T @ GRAVITY, self._period)


def rotation_vector(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) rotation vector in rad of a rotation by less than a half turn."""
    sine = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    length = np.sqrt(sine @ sine)
    angle = np.arctan2(length, (np.trace(R) - 1) / 2)
    return sine * (angle / length) if length > 0 else sine


def _roads(surface: TrueSurface) -> Traversability:
    """The true surface as the robot's own planner sees a measured one: ramps are met head-on."""
    nowhere = np.zeros(surface.grid.shape, np.bool_)
    roads = assess(surface.grid, surface.height.astype(np.float32), nowhere, nowhere, MODEL)
    traversable, turnable = roads.traversable & surface.drivable, roads.turnable & surface.drivable
    return replace(roads, traversable=traversable, turnable=turnable)
