"""The task as a dm_control environment: a robot in an arena, driven by velocity commands."""

import mujoco
import numpy as np
from dm_control import composer, mjcf
from dm_env import specs
from numpy.typing import NDArray

from pipeline.robot import Velocity
from sarsim.arenas.arena import RescueArena
from sarsim.robots.model import ROBOTS
from sarsim.robots.skid_steer import SkidSteer
from sarsim.robots.skid_steered import SkidSteered

CONTROL_TIMESTEP = 0.02
"""s, the period of the drive's firmware."""


class RescueTask(composer.Task):
    """Drive through a rescue arena; an action is (v m/s, ω rad/s).

    There is no reward: the report of an episode scores the robot.
    """

    def __init__(self, arena: RescueArena, robot: SkidSteered):
        self._arena = arena
        self.robot = robot
        self._frame = arena.add_free_entity(robot)
        self._drive = SkidSteer(self.robot.drive)
        self._inertial, self._measured = np.zeros((2, 3)), 0
        self.set_timesteps(CONTROL_TIMESTEP, arena.mjcf_model.option.timestep)
        robot.observables.enable_all()

    @property
    def root_entity(self) -> RescueArena:
        """The arena."""
        return self._arena

    def action_spec(self, physics: mjcf.Physics) -> specs.BoundedArray:
        """(v m/s, ω rad/s)."""
        limits = np.array(self.robot.drive.limits)
        return specs.BoundedArray((2,), np.float64, -limits, limits, name="v\tomega")

    def initialize_episode(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Set the robot down at the arena's start."""
        T = self._arena.T_world_start
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).ravel())
        self.robot.set_pose(physics, T[:3, 3], quat)
        self._drive = SkidSteer(self.robot.drive)

    def before_step(self, physics: mjcf.Physics, action: NDArray, random_state: np.random.RandomState) -> None:
        """Let the drive's firmware turn the command (2,), m/s and rad/s, into wheel speeds."""
        wheels = self._drive.command(
            Velocity(float(action[0]), float(action[1])),
            self.robot.wheel_speed(physics),
            float(self.robot.gyro(physics)[2]),
            CONTROL_TIMESTEP,
        )
        self.robot.set_wheel_speed(physics, *wheels)

    def after_substep(self, physics: mjcf.Physics, random_state: np.random.RandomState) -> None:
        """Let the inertial sensors measure."""
        self._inertial += self.robot.gyro(physics), self.robot.accelerometer(physics)
        self._measured += 1

    def inertial(self) -> NDArray[np.float64]:
        """(2, 3) mean of the gyros, rad/s, and of the accelerometers, m/s², since the last call.

        Inertial sensors sample much faster than they report (Xsens MTi: at 2 kHz), so that vibration averages out.
        """
        mean = self._inertial / self._measured
        self._inertial, self._measured = np.zeros((2, 3)), 0
        return mean

    def get_reward(self, physics: mjcf.Physics) -> float:
        """Always 0."""
        return 0.0


def rescue_environment(arena: RescueArena, seed: int, robot: str = ROBOTS[0]) -> composer.Environment:
    """The dm_env environment of a robot, see :class:`SkidSteered`, in an arena, without a time limit."""
    return composer.Environment(
        RescueTask(arena, SkidSteered(robot)), random_state=seed, strip_singleton_obs_buffer_dim=True
    )
