"""The simulated robot that the pipeline drives."""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from dm_control.rl.control import PhysicsError
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.robot import Motion, Velocity
from pipeline.sensor import XTION
from pipeline.transforms import from_yaw, yaw_of
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.things.thing import things_of
from sarsim.arenas.things.warmth import temperatures
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment
from sarsim.ground_truth.contacts import CollisionCounter
from sarsim.robots.model import paced_model, robot_sensor
from sarsim.robots.names import ROBOTS
from sarsim.robots.pose import TrajectorySample
from sarsim.sensors.air import Air
from sarsim.sensors.camera import LabelledImage, RgbdCamera, geom_objects
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting, set_lighting
from sarsim.sensors.odometry import WheelOdometry
from sarsim.sensors.rendering import Renderer
from sarsim.sensors.thermal import ThermalCamera
from sarsim.sensors.xtion import MAX_INCIDENCE, Xtion
from sarsim.settings import CAMERA_SIZE
from sarsim.trial_drive import warn_of_symptoms

SENSORS = {"xtion": Xtion(), "ideal": Xtion.ideal()}
SETTLING_TIME = 0.5
"""s, time for which the robot stands still before the episode starts."""


@dataclass(frozen=True)
class SimulationConfig:
    """Settings of the simulation.

    Attributes:
        odometry: the true pose, or dead reckoning with wheel encoders and inertial sensors.
        sensor: the Xtion with its noise, or only with its limited range.
        lighting: lighting of the arena; in the dark, the robot's lamp is on.
        dust: dust in the air, from 0 to 1; it absorbs depth returns, causes false returns and veils colours.
        speed: the robot's maximum speed, m/s; by default, its model's.
        robot: see :class:`sarsim.robots.skid_steered.SkidSteerRobot`.
        tyre_error: relative error of the wheels' radius, unknown to the odometry.
        camera_size: width and height of the camera's images, pixels.
    """

    odometry: Literal["truth", "wheel"] = "wheel"
    sensor: Literal["xtion", "ideal"] = "xtion"
    lighting: Literal["normal", "dim", "dark"] = "normal"
    dust: float = 0.0
    speed: float | None = None
    robot: str = ROBOTS[0]
    tyre_error: float = 0.0
    camera_size: tuple[int, int] = CAMERA_SIZE


@dataclass(frozen=True, eq=False)
class TrueFrame:
    """A frame without noise, with its true pose.

    Attributes:
        T_world_base: 4×4 true pose of the robot.
        image: noise-free image, which shows depth only where the sensor's range and angles allow a return.
    """

    T_world_base: NDArray[np.float64]
    image: LabelledImage

    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the noise-free returns in the world frame, m."""
        return self.image.intrinsics.points(self.image.depth, self.image.T_world_camera)


class SimulatedRobot:
    """A simulated :class:`pipeline.robot.Robot` in an arena, whose ``odom`` is the world frame.

    Attributes:
        arena: the arena that contains the robot.
        model: the robot's size and abilities.
        sensor: range and noise of the robot's camera; the sensor named in each frame is limited to precise depths.
        noise_free_sensor: range, and smallest angle between ray and surface, of the returns in noise-free frames.
        T_world_start: 4×4 pose at which the robot was placed.
        physics: dm_control's physics, for scores and drawings.
        object_of_geom: (ngeom + 1,) int32, id of each geom's object, from
            :func:`sarsim.sensors.camera.geom_objects`; ``object_of_geom[frame.instance]`` is an image of object ids.
        true_frame: the newest frame without noise; None before the first.
        trajectory: true and odometry pose after each control period.
        collisions: counts the robot's contacts with walls, clutter and victims.
    """

    control_period = 2 * CONTROL_TIMESTEP

    def __init__(self, arena: RescueArena, config: SimulationConfig, seed: int):
        """Place the robot at the arena's start; InputError if it cannot stand there."""
        self.arena, self.config = arena, config
        lighting = Lighting[config.lighting]
        self.sensor = robot_sensor(config.robot) or XTION
        nearest, farthest = self.sensor.nearest, self.sensor.farthest
        sensor = replace(SENSORS[config.sensor], min_range=nearest, max_range=farthest)
        # Without noise, the sensor still gets no return at grazing angles, so no robot could see such ground.
        self._noise_free = replace(SENSORS["ideal"], min_range=nearest, max_range=farthest, grazing=sensor.grazing)
        min_grazing_angle = np.radians(90 - MAX_INCIDENCE) if sensor.grazing else 0.0
        self.noise_free_sensor = replace(self.sensor, min_grazing_angle=min_grazing_angle)
        self._conditions = Conditions(sensor, lighting, Air(config.dust))
        warn_of_symptoms(config.robot)
        self._environment = RescueEnvironment(arena, config.robot)
        self.robot = self._environment.robot
        self.model = paced_model(config.robot, config.speed)
        self.physics = self._environment.physics
        set_lighting(self.physics, self.robot, lighting)
        self.renderer = Renderer(self.physics.model.ptr, *config.camera_size)
        self._camera = RgbdCamera(self.renderer, self.robot.camera.full_identifier)
        self.object_of_geom = geom_objects(self.physics.model.ptr)
        things = things_of(self.physics.model.ptr, self.physics.data.ptr)
        self._thermal = ThermalCamera(temperatures(self.physics.model.ptr, things))
        self._living = [thing.geoms for thing in things if thing.is_warm]
        self.T_world_start = arena.T_world_start
        # Level even if the robot starts on a slope, because the odometry measures the slope's tilt.
        x, y, z = self.T_world_start[:3, 3]
        self._T_world_odom = from_yaw(x, y, z, yaw_of(self.T_world_start))
        with ExitStack() as refused:
            refused.callback(self.close)
            self._begin(seed)
            refused.pop_all()

    def reset(self, seed: int) -> None:
        """Return the robot to the start, in the state of a new robot with this seed."""
        self._environment.reset()
        self._begin(seed)

    def _begin(self, seed: int) -> None:
        sensor_seed, odometry_seed, thermal_seed = np.random.SeedSequence(seed).spawn(3)
        self._sensor_rng, self._thermal_rng = np.random.default_rng(sensor_seed), np.random.default_rng(thermal_seed)
        radius, rng = self.robot.drive.wheel_radius, np.random.default_rng(odometry_seed)
        self._odometry = WheelOdometry(rng, radius, self.config.tyre_error)
        self.collisions = CollisionCounter(self.physics.model.ptr, self.base_body, self._living)
        self.true_frame: TrueFrame | None = None
        self.trajectory: list[TrajectorySample] = []
        self._settle()

    def _settle(self) -> None:
        cause: PhysicsError | None = None
        try:
            for _ in range(round(SETTLING_TIME / self.control_period)):
                self.drive(Velocity())
        except PhysicsError as error:
            cause = error
        # Physics pushes a robot out of an obstacle, so it would begin elsewhere than at its start.
        if cause or self.collisions.collisions:
            x, y = self.T_world_start[:2, 3]
            with self.arena.prefixing_errors():
                raise InputError(
                    f"the robot cannot stand at its start, ({x:g}, {y:g}) m; choose a free place with --start X Y YAW"
                ) from cause

    @property
    def base_body(self) -> int:
        """Id of the body ``base_link`` in the compiled model."""
        return self._camera.base_body

    @property
    def time(self) -> float:
        """Simulated time since the robot was placed, s."""
        return float(self.physics.time())

    @property
    def dead_reckoned_T_world_base(self) -> NDArray[np.float64]:
        """4×4 pose in the world by dead reckoning, even if the pipeline receives the true pose."""
        return self._T_world_odom @ self._odometry.T_odom_base

    @property
    def wheels(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(4,) angles in rad and (4,) speeds in rad/s of the wheels."""
        return self.robot.encoders(self.physics), np.array(self.physics.bind(self.robot.wheels).qvel)

    def sense(self) -> Frame:
        """Take a frame at the robot's current pose."""
        truth = self._camera.capture(self.physics.data.ptr)
        image = self._conditions.sense(truth, self._sensor_rng)
        noise_free = self._noise_free.apply(truth, self._sensor_rng)
        pose = self.trajectory[-1]
        self.true_frame = TrueFrame(pose.T_world_base, noise_free)
        thermal = self._thermal.image(truth, self._thermal_rng)
        return replace(image.frame(pose.time, pose.T_odom_base), thermal=thermal, sensor=self.sensor.precise)

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period."""
        for _ in range(round(self.control_period / CONTROL_TIMESTEP)):
            self._environment.drive(command)
            self.collisions.count(self.physics.data.ptr)
        robot, physics = self.robot, self.physics
        gyro, accelerometer = self._environment.inertial_measurements()
        self._odometry.update(robot.wheel_angle(physics), gyro, accelerometer, self.control_period)
        T_world_base = robot.T_world_base(physics)
        T_odom_base = T_world_base if self.config.odometry == "truth" else self.dead_reckoned_T_world_base
        self.trajectory.append(TrajectorySample(self.time, T_world_base, T_odom_base))
        wheel_speed = robot.wheel_speed(physics) * robot.drive.wheel_radius
        return Motion(self.time, T_odom_base, gyro, accelerometer, wheel_speed)

    def close(self) -> None:
        """Free the renderer and the environment."""
        self.renderer.close()
        self._environment.close()
