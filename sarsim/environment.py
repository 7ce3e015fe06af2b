"""A robot in an arena as a dm_env environment, driven by velocity commands."""

import logging
from collections.abc import Iterator

import dm_env
import mujoco
import numpy as np
from dm_control import mjcf
from dm_control.rl.control import PhysicsError
from dm_env import specs
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.robot import Velocity
from sarsim.arenas.arena import RescueArena
from sarsim.robots.names import ROBOTS
from sarsim.robots.skid_steer import SkidSteerController
from sarsim.robots.skid_steered import SkidSteerRobot, per_side

CONTROL_TIMESTEP = 0.02
"""s, control period of the drive's firmware."""
FILE_LOCAL_SETTINGS = {"compiler": ("autolimits", "fusestatic"), "size": ("memory", "nstack", "njmax", "nconmax")}
"""Attributes, by MJCF element, that do not affect a valid model; a merged model can have only one of each."""
MEDIUM = ("gravity", "wind", "magnetic", "density", "viscosity")
"""Options that describe the robot's surroundings, not the solver."""


class UnstableError(PhysicsError, InputError):
    """The physics diverge, because the robot or the arena is modelled badly."""


class RescueEnvironment(dm_env.Environment):
    """A drive through a rescue arena, with no time limit and no reward; an action is (v, ω), m/s and rad/s.

    Attributes:
        robot: the robot in the arena.
        physics: dm_control's physics of the arena with the robot.
        firmware: firmware of the robot's drive.
    """

    def __init__(self, arena: RescueArena, robot: str = ROBOTS[0]):
        """Place ``robot``, named as in :class:`SkidSteerRobot`, at the arena's start.

        Raises:
            InputError: the robot does not exist, its time step does not divide ``CONTROL_TIMESTEP``, or the arena and
                the robot cannot be compiled as one model.
        """
        self._T_world_start = arena.T_world_start
        self.robot = SkidSteerRobot(robot)
        _reconcile(arena.mjcf_model, self.robot.mjcf_model)
        try:
            _attach_robot(arena, self.robot)
            self.physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
        except (ValueError, mujoco.FatalError) as error:
            raise InputError(
                f"the arena and the robot cannot be combined in one MuJoCo model: {' '.join(str(error).split())}"
            ) from error
        self._substeps = substeps(self.physics.timestep())
        self._sensor_sum = np.zeros(self.physics.model.nsensordata)
        self._inertial_indices = self.robot.inertial_indices(self.physics)
        self._wheels = np.array(self.physics.bind(self.robot.wheels).dofadr)
        self._servos = self.physics.bind(self.robot.actuators).element_id
        self.reset()

    def reset(self) -> dm_env.TimeStep:
        """Place the robot at the arena's start."""
        T, quat = self._T_world_start, np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T[:3, :3]).ravel())
        with self.physics.reset_context():
            self.robot.set_pose(self.physics, T[:3, 3], quat)
        self.firmware = SkidSteerController(self.robot.drive)
        self._sensor_sum[:], self._sample_count = 0, 0
        return dm_env.restart(self._observation())

    def step(self, action: NDArray[np.float64]) -> dm_env.TimeStep:
        """Follow a command (v, ω), m/s and rad/s, for ``CONTROL_TIMESTEP``; UnstableError if the physics diverge."""
        self.drive(Velocity(float(action[0]), float(action[1])))
        return dm_env.transition(reward=0.0, observation=self._observation())

    def drive(self, command: Velocity) -> None:
        """Follow a command for ``CONTROL_TIMESTEP`` as :meth:`step` does, but without an observation."""
        physics = self.physics
        if physics.is_dirty:  # after a write through dm_control
            physics.forward()
        model, data = physics.model.ptr, physics.data.ptr
        speed, gyro_z = per_side(data.qvel[self._wheels]), float(data.sensordata[self._inertial_indices[2]])
        data.ctrl[self._servos] = self.firmware.command(command, speed, gyro_z, CONTROL_TIMESTEP)
        warned = data.warning.number.tolist()
        self._advance(model, data)
        if data.warning.number.tolist() != warned:
            names = [mujoco.mjtWarning(int(n)).name for n in np.flatnonzero(data.warning.number != warned)]
            raise UnstableError(
                f"the simulation became unstable; MuJoCo warned: {', '.join(names)}; check masses, inertias,"
                " the timestep, and shapes that overlap"
            )

    def _advance(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        for substep in range(self._substeps):
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)  # contacts and gyro measurements of the new state
            if substep == 0:  # as dm_control does at the first read after a write, to update accelerations
                mujoco.mj_forwardSkip(model, data, mujoco.mjtStage.mjSTAGE_VEL, skipsensor=False)
            self._sensor_sum += data.sensordata
        self._sample_count += self._substeps

    def inertial_measurements(self) -> NDArray[np.float64]:
        """(2, 3) mean measurements of the gyros, rad/s, and of the accelerometers, m/s², since the last call.

        Inertial sensors sample much faster than they report (Xsens MTi: at 2 kHz), so vibration averages out.
        """
        mean = (self._sensor_sum[self._inertial_indices] / self._sample_count).reshape(2, 3)
        self._sensor_sum[:], self._sample_count = 0, 0
        return mean

    def action_spec(self) -> specs.BoundedArray:
        """The bounds of an action (v, ω), m/s and rad/s."""
        limits = np.array(self.robot.drive.limits)
        return specs.BoundedArray((2,), np.float64, -limits, limits, name="v\tomega")

    def observation_spec(self) -> dict[str, specs.Array]:
        """The shapes and types of :meth:`SkidSteerRobot.measurements`."""
        return {name: specs.Array(value.shape, value.dtype, name) for name, value in self._observation().items()}

    def _observation(self) -> dict[str, NDArray[np.float64]]:
        return self.robot.measurements(self.physics)

    def close(self) -> None:
        """Free the physics."""
        self.physics.free()


def _attach_robot(arena: RescueArena, robot: SkidSteerRobot) -> None:
    if robot.free_joint_attributes:
        arena.attach(robot).add("joint", type="free", **robot.free_joint_attributes)
    else:
        arena.add_free_entity(robot)


def _reconcile(arena: mjcf.RootElement, robot: mjcf.RootElement) -> None:
    """Prepare the models of an arena and a robot for compilation as one model.

    Both keep their elements. The arena sets ``MEDIUM`` and the light. The robot sets all other options of the
    physics; those that it omits get MuJoCo's defaults.
    """
    for root in (arena, robot):
        root.keyframe.remove()  # states of the model in one file, not of the merged model
        for tag, names in FILE_LOCAL_SETTINGS.items():
            for name in names:
                setattr(getattr(root, tag), name, None)
    robot.visual.remove()
    robot.statistic.remove()
    for name in {*arena.size.get_attributes()} & {*robot.size.get_attributes()}:
        larger = max(getattr(arena.size, name), getattr(robot.size, name))
        setattr(arena.size, name, larger)
        setattr(robot.size, name, larger)
    for name in MEDIUM:
        setattr(robot.option, name, None)
    lost = [*_clear_options(arena.option, robot.option), *_clear_options(arena.option.flag, robot.option.flag)]
    if lost:
        logging.getLogger(__name__).warning("using the robot's physics options, not the arena's: %s", ", ".join(lost))


def _clear_options(arena: mjcf.Element, robot: mjcf.Element) -> Iterator[str]:
    """Clear an arena's options except ``MEDIUM``, and yield a text for each option whose value the robot changes."""
    given, wanted = arena.get_attributes(), robot.get_attributes()
    for name in sorted(given.keys() - {*MEDIUM}):
        if name not in wanted or np.any(given[name] != wanted[name]):
            yield f"{name} {wanted.get(name, '(default)')} instead of {given[name]}"
        setattr(arena, name, None)


def substeps(timestep: float) -> int:
    """Number of time steps of ``timestep`` s in ``CONTROL_TIMESTEP``; InputError if this is not an integer."""
    number = round(CONTROL_TIMESTEP / timestep)
    if not np.isclose(number * timestep, CONTROL_TIMESTEP):
        raise InputError(
            f"the robot's timestep of {timestep:g} s must divide the control period of {CONTROL_TIMESTEP:g} s evenly;"
            " change it in the <option> of the MJCF file"
        )
    return number
