"""``sarsim/Drive-v0``: drive the robot in MuJoCo with velocity commands, 0.1 s per step."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import mujoco
import numpy as np
import open3d as o3d
from dm_control.rl.control import PhysicsError
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.errors import InputError, required
from pipeline.robot import Velocity
from pipeline.sensor import XTION
from pipeline.transforms import yaw_of
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment
from sarsim.ground_truth.contacts import CollisionCounter
from sarsim.ground_truth.meshes import true_scene
from sarsim.ground_truth.true_surface import Survey
from sarsim.methods.arena import make_arena
from sarsim.sensors.camera import camera_intrinsics, optical_pose
from sarsim.sensors.odometry import WheelOdometry
from sarsim.tasks.checks import CLOSED, NOT_RESET, USED, check_choice, check_options, numbers_of, weights_of
from sarsim.trial_drive import warn_of_symptoms

PERIODS_PER_STEP = 5
"""Control periods of the drive's firmware per step."""
SETTLING_PERIODS = 25
"""Control periods for which the robot stands still before an episode: 0.5 s, as in sarsim-episode."""
ARRIVED_WITHIN = 0.3
"""Distance from the goal at which the robot has arrived, m."""
MIN_UPRIGHT_Z = np.cos(np.deg2rad(60))
"""A robot has tipped over if the z component, in the world, of its own z axis is less than this."""
MAX_SEEDS = 1_000_000
"""Number of seeds, and of random arenas, from which episodes are drawn."""
MEASURED_PARTS = {"gyro": slice(3), "accelerometer": slice(3, 6), "odometry": slice(6, 10), "goal": slice(10, 12)}
"""The slice of each measurement in the array of all measurements."""
MEASURED_BOUNDS = np.repeat(np.array([100, 1000, 10_000, 10_000], np.float32), [3, 3, 4, 2])
"""Magnitudes to which measurements are clipped, in rad/s, m/s² and m."""


@dataclass(frozen=True)
class DriveWeights:
    """Weights of a driving agent's reward, which is the weighted sum of a step's quantities.

    Attributes:
        progress: reward per m by which the distance to the goal shrinks.
        time: reward per second.
        contact: reward per contact with a wall, clutter or a victim.
        tipping: reward for tipping over, or if the simulation diverges.
    """

    progress: float = 1.0
    time: float = -0.1
    contact: float = -1.0
    tipping: float = -10.0


class DepthRays:
    """A camera's rays and the surfaces that they can hit: visible geoms except the robot's, at their initial poses.

    The rays are cast by Open3D (Embree), without a renderer.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, camera_id: int, size: tuple[int, int]):
        """Cover the camera's whole field of view with images of ``size``: width and height, pixels."""
        self._scene = true_scene(model, data, model.cam_bodyid[camera_id])
        k = camera_intrinsics(model, camera_id, *size)
        u, v = np.meshgrid(np.arange(k.width) + 0.5, np.arange(k.height) + 0.5)
        self._optical = np.stack([(u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones_like(u)], axis=-1)

    def depth(self, T_world_camera: Pose) -> NDArray[np.float32]:
        """(height, width) float32 depths along the optical axis, m; 0 where a ray hits no surface."""
        along = self._optical @ T_world_camera[:3, :3].T
        origins = np.broadcast_to(T_world_camera[:3, 3], along.shape)
        rays = np.ascontiguousarray(np.concatenate([origins, along], axis=-1), np.float32)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)["t_hit"].numpy()
        return np.where(np.isfinite(hit), hit, 0).astype(np.float32)


DEFAULT_DRIVE = DriveWeights()


class Drive(gymnasium.Env[Any, Any]):
    """Drive to a goal.

    An action is a forward speed and a turn rate, each in [-1, 1], as fractions of the drive's limits.

    An observation has these keys:

    - ``gyro``: (3,) rad/s, mean over the step;
    - ``accelerometer``: (3,) m/s², mean over the step;
    - ``odometry``: (4,) x and y from the start, m, and cosine and sine of the heading, from wheel odometry;
    - ``goal``: (2,) m, x (forward) and y (left) of the goal in the robot's frame, from the true pose;
    - ``depth``, only if requested: (height, width) m, depths along the optical axis; 0 beyond 3.5 m.

    An episode terminates when the robot reaches the goal or tips over, or when the simulation diverges. It is
    truncated after ``seconds``.

    Attributes:
        world: the physics; None before the first reset.
        rays: ray caster of the camera; None without depth.
        camera_id: id of the robot's camera in the MuJoCo model.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "render_modes": [],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        arena: str = "nist_6x4",
        *,
        robot: str = "pioneer3at",
        depth: tuple[int, int] | None = None,
        seconds: float = 60.0,
        weights: DriveWeights | Mapping[str, float] = DEFAULT_DRIVE,
        render_mode: None = None,
    ):
        """Choose the arena and the sensors.

        Args:
            arena: as in run_episode.py; ``random``: a new random arena for each episode.
            robot: as in run_episode.py.
            depth: width and height of the depth image, pixels; None for no depth image.
            seconds: time after which an episode is truncated, s.
            weights: weights of the reward.
            render_mode: None, because there is nothing to render.
        """
        check_choice("render_mode", render_mode, (None,))
        if not isinstance(seconds, int | float) or not 0 < seconds < np.inf:
            raise InputError(f"seconds = {seconds}: must be positive and finite")
        is_pair = isinstance(depth, Sequence) and len(depth) == 2
        if depth is not None and not (is_pair and all(isinstance(n, int) and n >= 1 for n in depth)):
            raise InputError(f"depth = {depth}: must be a width and a height of at least 1 pixel each")
        self._arena, self._robot, self._size, self._seconds = arena, robot, depth, seconds
        self._weights = weights_of(DriveWeights, weights)
        self.render_mode, self._is_closed = render_mode, False
        self.world: RescueEnvironment | None = None
        self.rays: DepthRays | None = None
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        found: dict[str, spaces.Space[Any]] = {
            name: spaces.Box(-MEASURED_BOUNDS[part], MEASURED_BOUNDS[part], dtype=np.float32)
            for name, part in MEASURED_PARTS.items()
        }
        if depth is not None:
            found["depth"] = spaces.Box(0.0, XTION.farthest, depth[::-1], np.float32)
        self.observation_space = spaces.Dict(found)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
        """Place the robot at the start, and draw a goal; InputError if the task is closed, or options are given."""
        check_options(options)
        super().reset(seed=seed)
        if self._is_closed:
            raise InputError(CLOSED)
        if self.world is None or self._arena == "random":
            self._load()
        world = required(self.world)
        world.reset()
        for _ in range(SETTLING_PERIODS):
            world.drive(Velocity())
        self._start = world.physics.time()
        self._collisions = CollisionCounter(world.physics.model.ptr, self._body)
        self._odometry = WheelOdometry(self.np_random, world.robot.drive.wheel_radius)
        self._goal: NDArray[np.float64] = self._goals[int(self.np_random.integers(len(self._goals)))]
        self._steps, self._distance_driven, self._seen = 0, 0.0, self._observe()
        self._last_position = self._position
        return self._seen, self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Apply the command, which the firmware clips to the drive's limits, for 0.1 s.

        Raises:
            InputError: the command is not two finite numbers, or the task is closed or has not been reset.
        """
        if self._is_closed:
            raise InputError(CLOSED)
        if self.world is None:
            raise InputError(NOT_RESET)
        command = Velocity(*(numbers_of(action, 2) * self.world.robot.drive.limits).tolist())
        hits, far, diverged = self._collisions.collisions, self._distance, False
        try:
            for _ in range(PERIODS_PER_STEP):
                self.world.drive(command)
                self._collisions.count(self.world.physics.data.ptr)
            self._seen = self._observe()
        except PhysicsError:
            diverged = True  # MuJoCo has reset the state, so the last observation stands
        self._steps += 1
        moved, self._last_position = self._position - self._last_position, self._position
        self._distance_driven += math.sqrt(moved @ moved)
        tipped = diverged or bool(self._pose[2, 2] < MIN_UPRIGHT_Z)
        weights, contacts = self._weights, self._collisions.collisions - hits
        reward = weights.progress * (far - self._distance) + weights.time * PERIODS_PER_STEP * CONTROL_TIMESTEP
        reward += weights.contact * contacts + weights.tipping * tipped
        is_over = bool(tipped or self._distance < ARRIVED_WITHIN)
        is_cut = not is_over and self._time >= self._seconds - CONTROL_TIMESTEP / 2
        return self._seen, float(reward), is_over, bool(is_cut), self._info() | {"navigation.tipped": int(tipped)}

    def __getstate__(self) -> dict[str, Any]:
        """The state of the task for a copy; InputError after a reset, because the physics cannot be copied."""
        if self.world is not None:
            raise InputError(USED)
        return self.__dict__.copy()

    def close(self) -> None:
        """Free the physics."""
        if self.world is not None:
            self.world.close()
        self.world, self._is_closed = None, True

    def _load(self) -> None:
        if self.world is not None:
            self.world.close()
        name = f"random:{self.np_random.integers(MAX_SEEDS)}" if self._arena == "random" else self._arena
        arena = make_arena(name)
        warn_of_symptoms(self._robot)
        self.world = RescueEnvironment(arena, self._robot)
        model, data = self.world.physics.model.ptr, self.world.physics.data.ptr
        self.camera_id = int(model.camera(self.world.robot.camera.full_identifier).id)
        self._body = int(model.body_rootid[model.cam_bodyid[self.camera_id]])
        with arena.prefixing_errors():
            survey = Survey(model, data, self._body, self.world.robot.model)
            surface = survey.surface_from(arena.T_world_start[:3, 3])
        self._goals: NDArray[np.float64] = surface.grid.centre_of(np.argwhere(surface.drivable))
        self.rays = DepthRays(model, data, self.camera_id, self._size) if self._size else None

    def _observe(self) -> dict[str, NDArray[np.float32]]:
        world = required(self.world)
        physics = world.physics
        gyro, accelerometer = world.inertial_measurements()
        dt = PERIODS_PER_STEP * CONTROL_TIMESTEP
        T_odom_base = self._odometry.update(world.robot.wheel_angle(physics), gyro, accelerometer, dt)
        self._pose = pose = world.robot.T_world_base(physics)
        self._position, to_goal = pose[:2, 3], self._goal - pose[:2, 3]
        self._distance = math.sqrt(to_goal @ to_goal)
        self._time = physics.time() - self._start
        yaw = yaw_of(T_odom_base)
        odometry = *T_odom_base[:2, 3], np.cos(yaw), np.sin(yaw)
        values = np.concatenate([gyro, accelerometer, odometry, pose[:2, :2].T @ to_goal], dtype=np.float32)
        values = np.minimum(np.maximum(values, -MEASURED_BOUNDS), MEASURED_BOUNDS)
        found = {name: values[part] for name, part in MEASURED_PARTS.items()}
        if self.rays is not None:
            depth = self.rays.depth(optical_pose(physics.data.ptr, self.camera_id))
            found["depth"] = np.where(depth <= XTION.farthest, depth, 0)
        return found

    def _info(self) -> dict[str, Any]:
        """Figures of the episode so far, under the keys of report.json."""
        return {
            "steps": self._steps,
            "sim_time_s": self._time,
            "navigation.distance_m": self._distance_driven,
            "navigation.collisions": self._collisions.collisions,
            "navigation.reached": int(self._distance < ARRIVED_WITHIN),
        }
