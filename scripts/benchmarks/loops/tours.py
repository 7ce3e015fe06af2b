"""Tours: a robot follows waypoints by its true pose, and its depth images and odometry are recorded.

The robot slips a few times, and is carried elsewhere once, so that localisation has something to correct.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Place, Places, Pose, Poses, Values
from pipeline.files import atomic_write
from pipeline.frame import Frame, Intrinsics
from pipeline.localisation.config import KeyframePolicy
from pipeline.planning.pose_paths import PosePaths
from pipeline.robot import Velocity
from pipeline.transforms import wrap_angle, yaw_of
from sarsim.ground_truth.true_surface import Survey
from sarsim.scoring.oracle import true_traversability
from sarsim.scoring.trajectory import is_tipped
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.kidnappings import set_down
from scripts.benchmarks.loops.worlds import World, world_of

LOOK_AHEAD = 0.4  # m, minimum look-ahead distance for steering
ARRIVAL_DISTANCE = 0.25  # m, maximum distance from a waypoint at which the waypoint is reached
TURN_IN_PLACE = np.deg2rad(40)
"""rad; if the path's direction differs more from the robot's heading, the robot turns in place."""
SLIP_COUNT, SLIP_TIME, SLIP_FRICTION = 3, 1.0, 0.002
"""Number of slips of a tour, duration of a slip, s, and friction of all surfaces during a slip."""
STANDING_TIME = 5.0  # s, time for which the robot stands still after it was carried
STEEP_TILT = np.deg2rad(4)
"""rad, minimum tilt of the robot at which it drives slowly."""
HELD_TIME = 4.0
"""Time without progress, s, after which the robot backs out and drives elsewhere."""
GREY_SIZE = 80, 60  # Width and height of the stored grey images, pixels
MAX_TIME_PER_METRE = 8.0  # s per m of the tour's length; a tour that takes longer ends
DEPTH_UNIT = 1e-4  # m, unit of the stored depth images
KEYFRAME_SPACING = KeyframePolicy()
"""Frames are as far apart as keyframes."""


@dataclass(frozen=True, eq=False)
class Tour:
    """A robot's measurements and true poses on a tour.

    Attributes:
        times: (N,) time of each frame, s.
        true: (N, 4, 4) true pose of ``base_link`` at each frame.
        odometry: (N, 4, 4) pose by wheels and gyro.
        T_base_camera: (N, 4, 4) pose of the camera on the robot.
        was_carried: (N,) whether the robot was carried between the previous frame and this frame.
        intrinsics: (6,) width, height, focal lengths and principal point of the camera, pixels.
        grey: (N, 60, 80) uint8 grey images, whose detail suffices to detect whether the view has changed.
        ends: (N,) end of each frame's depth image in ``images``, bytes.
        images: concatenated PNG files of the depth images of all frames.
    """

    times: Values
    true: Poses
    odometry: Poses
    T_base_camera: Poses
    was_carried: NDArray[np.bool_]
    intrinsics: Values
    grey: NDArray[np.uint8]
    ends: NDArray[np.int64]
    images: NDArray[np.uint8]

    @classmethod
    def load(cls, file: Path) -> "Tour":
        """Read a tour that :func:`record` has written."""
        with np.load(file) as content:
            return cls(**content)

    def frames(self) -> Iterator[Frame]:
        """Yield the frames, with enlarged grey images in place of the colour images."""
        width, height, *rest = self.intrinsics
        intrinsics = Intrinsics(int(width), int(height), *map(float, rest))
        for k, (start, end) in enumerate(zip(np.append(0, self.ends), self.ends, strict=False)):
            image = cv2.imdecode(self.images[start:end], cv2.IMREAD_UNCHANGED)
            size = intrinsics.width, intrinsics.height
            grey = cv2.resize(self.grey[k], size, interpolation=cv2.INTER_NEAREST)
            rgb = np.repeat(grey[..., None], 3, axis=2)
            depth = np.asarray(image, np.float32) * np.float32(DEPTH_UNIT)
            yield Frame(
                time=float(self.times[k]),
                rgb=rgb,
                depth=depth,
                intrinsics=intrinsics,
                T_base_camera=self.T_base_camera[k],
                T_odom_base=self.odometry[k],
            )


def record(world: str, seed: int, length: float, file: Path) -> None:
    """Drive ``length`` m through a world, and write the :class:`Tour`."""
    place = world_of(world, seed)
    robot = SimulatedRobot(place.arena, SimulationConfig(odometry="wheel"), seed)
    try:
        drive = Drive(robot, np.random.default_rng([seed, 1]), length)
        paths = GraphPaths(place, drive) if place.nodes is not None else GroundPaths(drive)
        drive.follow(paths)
        with atomic_write(file) as part, part.open("wb") as stream:
            np.savez(stream, **drive.tour_content())
    finally:
        robot.close()


class Paths(ABC):
    """The paths of a tour, one after another."""

    @abstractmethod
    def next_path(self) -> Places | None:
        """(N, 2) m, positions on the path from the robot's true pose to the next waypoint; None if none is left."""

    @abstractmethod
    def on_carried(self) -> None:
        """Take into account that the robot was carried."""

    @abstractmethod
    def can_continue_from(self, place: Place) -> bool:
        """Whether the robot can continue from a position (2,), m."""


class GraphPaths(Paths):
    """A lap along the world's nodes, then a walk along the least visited edges."""

    def __init__(self, world: World, drive: "Drive") -> None:
        self._world, self._drive, self._rng = world, drive, drive.rng
        self._nodes = np.asarray(world.nodes)
        self._lap = list(world.lap)[1:]
        self._at, self._before = world.lap[0], -1
        self._visits = {frozenset(edge): 0 for edge in world.edges}

    def next_path(self) -> Places | None:
        """The path to the next node, or back to the previous node if the robot was blocked before it arrived."""
        is_away = np.linalg.norm(self._nodes[self._at, :2] - self._drive.place) > 2 * ARRIVAL_DISTANCE
        if is_away and frozenset((self._at, self._before)) in self._visits:
            there = self._before
            if self._lap:
                self._lap.insert(0, self._at)
        elif self._lap:
            there = self._lap.pop(0)
        else:
            edges = [edge for edge in self._visits if self._at in edge]
            weights = [self._visits[edge] + (2 if self._before in edge else 0) + self._rng.random() for edge in edges]
            (there,) = edges[int(np.argmin(weights))] - {self._at}
        edge = frozenset((self._at, there))
        self._visits[edge] = self._visits.get(edge, 0) + 1
        self._before, self._at = self._at, there
        return np.array([self._drive.place, self._nodes[there, :2]])

    def can_continue_from(self, place: Place) -> bool:
        """Whether a position (2,), m, is near a node."""
        return bool(np.linalg.norm(self._nodes[:, :2] - place, axis=1).min() < 0.5)

    def on_carried(self) -> None:
        """Continue from the nearest node."""
        self._lap.clear()
        self._at = int(np.linalg.norm(self._nodes - self._drive.T[:3, 3], axis=1).argmin())


class GroundPaths(Paths):
    """Paths on the true ground to random positions, planned by the robot's own planner."""

    def __init__(self, drive: "Drive") -> None:
        robot = drive.robot
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        survey = Survey(model, data, robot.base_body, robot.model)
        surface = survey.surface_from(robot.trajectory[-1].T_world_base[:3, 3])
        self._ground, self._drive = true_traversability(surface, robot.model), drive
        clear = ndimage.binary_erosion(surface.drivable, iterations=2)
        self._places = surface.grid.centre_of(np.argwhere(clear if clear.any() else surface.drivable))

    def next_path(self) -> Places | None:
        """The path to a random position that is reachable and more than 3 m away."""
        here, rng = self._drive.place, self._drive.rng
        paths = PosePaths(self._ground, here, self._drive.heading)
        for place in rng.permutation(self._places)[:50]:
            if np.linalg.norm(place - here) > 3 and np.isfinite(paths.cost_to(place)):
                return np.asarray(paths.path_to(place)[:, :2])
        return None

    def on_carried(self) -> None:
        """Do nothing, because the next path is planned from the robot's current position."""

    def can_continue_from(self, place: Place) -> bool:
        """True, because the robot has already driven at this position."""
        return True


class Drive:
    """A robot on its tour, and its recording.

    Attributes:
        robot: the robot.
        rng: random generator that determines the path, the slips and the position to which the robot is carried.
    """

    def __init__(self, robot: SimulatedRobot, rng: np.random.Generator, length: float) -> None:
        self.robot, self.rng, self._length = robot, rng, length
        self._driven = 0.0
        self._frames: list[tuple[float, Pose, Pose, Pose, bool]] = []
        self._images: list[NDArray[np.uint8]] = []
        self._grey: list[NDArray[np.uint8]] = []
        self._intrinsics = np.zeros(6)
        self._was_carried = False
        self._slip_distances = sorted(rng.uniform(0.05, 0.95, SLIP_COUNT) * length)
        self._carry_distance = rng.uniform(0.5, 0.8) * length

    @property
    def T(self) -> Pose:
        """True pose of ``base_link``."""
        return self.robot.trajectory[-1].T_world_base

    @property
    def place(self) -> Place:
        """(2,) true position, m."""
        return self.T[:2, 3]

    @property
    def heading(self) -> float:
        """True heading, rad."""
        return yaw_of(self.T)

    @property
    def has_tipped(self) -> bool:
        """Whether the robot has fallen over, which ends the tour."""
        return is_tipped(self.T)

    def follow(self, paths: Paths) -> None:
        """Drive until the tour is long enough."""
        self._take()
        most = MAX_TIME_PER_METRE * self._length
        while self._driven < self._length and self.robot.time < most and not self.has_tipped:
            if (path := paths.next_path()) is None:
                break
            for goal in path[1:]:
                if not self._drive_to(goal):
                    break
                if self._driven > self._carry_distance:
                    self._carry_distance = np.inf
                    self._be_carried(paths)
                    break

    def tour_content(self) -> dict[str, Any]:
        """The content of a :class:`Tour`."""
        times, true, odometry, T_base_camera, carried = zip(*self._frames, strict=True)
        return {
            "times": np.array(times),
            "true": np.array(true),
            "odometry": np.array(odometry),
            "T_base_camera": np.array(T_base_camera),
            "was_carried": np.array(carried),
            "intrinsics": self._intrinsics,
            "grey": np.array(self._grey),
            "ends": np.cumsum([len(image) for image in self._images]),
            "images": np.concatenate(self._images),
        }

    def _drive_to(self, goal: Places) -> bool:
        """Drive to a position (2,), m, in a straight line; False if the robot does not reach it."""
        model, nearest, since = self.robot.model, np.inf, self.robot.time
        while (distance := float(np.linalg.norm(goal - self.place))) > ARRIVAL_DISTANCE:
            if distance < nearest - 0.05:
                nearest, since = distance, self.robot.time
            if self.has_tipped:
                return False
            if self.robot.time - since > HELD_TIME + np.pi / model.turn_rate:
                self._send(Velocity(-0.2, 0.0), 1.5)
                return False
            is_steep = self.T[2, 2] < np.cos(STEEP_TILT)  # where a robot without grip would slide down
            if self._slip_distances and self._driven > self._slip_distances[0] and not is_steep:
                self._slip_distances.pop(0)
                self._slip()
            ahead = goal - self.place
            off = wrap_angle(np.arctan2(ahead[1], ahead[0]) - self.heading)
            speed, rate = (model.ramp_speed, model.ramp_turn_rate) if is_steep else (model.speed, model.turn_rate)
            if abs(off) > TURN_IN_PLACE:
                self._send(Velocity(0.0, float(np.clip(2.0 * off, -rate, rate))))
            else:
                v = min(speed, 0.15 + distance) * np.cos(off) ** 2
                turn = 2 * v * np.sin(off) / max(LOOK_AHEAD, min(distance, 1.0))
                self._send(Velocity(float(v), float(np.clip(turn, -rate, rate))))
        return True

    def _send(self, command: Velocity, seconds: float = 0.0) -> None:
        """Follow a command for ``seconds``, but for at least one control period, and take the frames that are due."""
        for _ in range(max(1, round(seconds / self.robot.control_period))):
            before = self.place.copy()
            self.robot.drive(command)
            self._driven += float(np.linalg.norm(self.place - before))
            if KEYFRAME_SPACING.is_due(self._frames[-1][2], self.robot.trajectory[-1].T_odom_base):
                self._take()

    def _slip(self) -> None:
        """Stop, and let the wheels spin for a while without grip."""
        self._send(Velocity(), 0.5)
        model = self.robot.physics.model.ptr
        friction = model.geom_friction.copy()
        model.geom_friction[:] = SLIP_FRICTION
        self._send(Velocity(0.4, 0.0), SLIP_TIME)
        self._send(Velocity(), 0.2)
        model.geom_friction[:] = friction

    def _be_carried(self, paths: Paths) -> None:
        """Set the robot down at an earlier pose of its tour from which it can continue."""
        earlier = [f[1] for f in self._frames if np.linalg.norm(f[1][:2, 3] - self.place) > 4]
        level = [T for T in earlier if T[2, 2] > np.cos(STEEP_TILT) and paths.can_continue_from(T[:2, 3])]
        if not level:
            return
        T, quat = level[self.rng.integers(len(level))], np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).ravel())
        set_down(self.robot, T[:3, 3] + [0, 0, 0.01], quat, STANDING_TIME)
        self._was_carried = True
        paths.on_carried()
        self._take()

    def _take(self) -> None:
        """Take a frame, and record it with the true pose."""
        frame = self.robot.sense()
        pose = self.robot.trajectory[-1]
        k = frame.intrinsics
        self._intrinsics = np.array([k.width, k.height, k.fx, k.fy, k.cx, k.cy])
        grey = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
        self._grey.append(np.asarray(cv2.resize(grey, GREY_SIZE, interpolation=cv2.INTER_AREA), np.uint8))
        image = np.rint(frame.depth / DEPTH_UNIT).astype(np.uint16)
        self._images.append(cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].ravel())
        self._frames.append((pose.time, pose.T_world_base, pose.T_odom_base, frame.T_base_camera, self._was_carried))
        self._was_carried = False
