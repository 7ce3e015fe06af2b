"""A skid-steered robot as a dm_control entity, defined by its MJCF alone."""

from collections.abc import Mapping
from dataclasses import fields
from functools import cache, cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from dm_control import composer, mjcf
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation
from sarsim.assets import asset
from sarsim.robots.skid_steer import DriveModel

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
SIDES = ("left", "right")
PARTS = [
    *(("body", "base_link"), ("camera", "camera"), ("light", "lamp")),
    *(("sensor", sensor) for sensor in ("gyro", "accelerometer")),
    *(("joint", wheel) for wheel in WHEELS),
    *(("actuator", side) for side in SIDES),
]
"""Kinds and names of the elements that the MJCF of a robot must have."""
ROBOTS = ("pioneer3at", "jackal")
"""Names of the robots that sarsim ships."""
Model = TypeVar("Model", RobotModel, DriveModel)


class SkidSteered(composer.Robot):
    """A robot with four wheels that cannot steer and an RGB-D camera; attach it with ``arena.add_free_entity``.

    Attributes:
        model: parameters for the pipeline.
        drive: parameters for its firmware.
    """

    def _build(self, robot: str = ROBOTS[0]) -> None:
        """``robot``: one of ``ROBOTS``, or the path of an MJCF file with the same names of parts and numbers.

        Raises:
            InputError: there is no such robot, or a required part or number is missing.
        """
        path = robot_file(robot)
        try:
            self._mjcf_root = mjcf.from_path(str(path))
        except OSError as error:
            raise InputError(f"--robot {robot}: {error.strerror or error}; known are {', '.join(ROBOTS)}") from error
        except (SyntaxError, ValueError, KeyError, AttributeError, TypeError) as error:
            raise InputError(f"--robot {robot}: not readable MJCF: {' '.join(str(error).split())}") from error
        find, numeric = self._mjcf_root.find, self._mjcf_root.custom.numeric
        if missing := [" ".join(part) for part in PARTS if find(*part) is None]:
            raise InputError(f"--robot {robot}: has no {', '.join(missing)}")
        numbers = {number.name: np.atleast_1d(np.array(number.data, np.float64)) for number in numeric}
        self.model: RobotModel = _filled(RobotModel, numbers, robot)
        self.drive: DriveModel = _filled(DriveModel, numbers, robot)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The MJCF model."""
        return self._mjcf_root

    @cached_property
    def base(self) -> mjcf.Element:
        """The body ``base_link``."""
        return self._mjcf_root.find("body", "base_link")

    @cached_property
    def wheels(self) -> tuple[mjcf.Element, ...]:
        """The four wheel joints, in the order of ``WHEELS``."""
        return tuple(self._mjcf_root.find("joint", name) for name in WHEELS)

    @cached_property
    def actuators(self) -> tuple[mjcf.Element, ...]:
        """The velocity servos of the left and right wheels; their control is in rad/s."""
        return tuple(self._mjcf_root.find("actuator", name) for name in SIDES)

    @cached_property
    def camera(self) -> mjcf.Element:
        """The camera, for both colour and depth."""
        return self._mjcf_root.find("camera", "camera")

    @cached_property
    def lamp(self) -> mjcf.Element:
        """The lamp below the camera, off until ``active`` is set."""
        return self._mjcf_root.find("light", "lamp")

    def encoders(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(4,) rad, the angle of every wheel."""
        return np.array(physics.bind(self.wheels).qpos)

    def wheel_speed(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(2,) rad/s of the left and right wheels."""
        return _per_side(np.asarray(physics.bind(self.wheels).qvel))

    def wheel_angle(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(2,) rad, unwrapped, of the left and right wheels."""
        return _per_side(self.encoders(physics))

    def gyro(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(3,) rad/s in ``base_link``."""
        return np.array(physics.bind(self._mjcf_root.find("sensor", "gyro")).sensordata)

    def accelerometer(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(3,) m/s² in ``base_link``, gravity included (+9.81 along z at rest on level ground)."""
        return np.array(physics.bind(self._mjcf_root.find("sensor", "accelerometer")).sensordata)

    def inertial_data(self, physics: mjcf.Physics) -> NDArray[np.int64]:
        """(6,) indices of the gyro's and the accelerometer's axes in MuJoCo's ``sensordata``."""
        sensors = [physics.bind(self._mjcf_root.find("sensor", name)) for name in ("gyro", "accelerometer")]
        return np.concatenate([np.arange(3) + physics.model.sensor_adr[sensor.element_id] for sensor in sensors])

    def measurements(self, physics: mjcf.Physics) -> dict[str, NDArray[np.float64]]:
        """What the robot's own sensors measure, by the names of the methods that describe it."""
        sensors = (self.encoders, self.wheel_speed, self.gyro, self.accelerometer)
        return {sensor.__name__: sensor(physics) for sensor in sensors}

    def set_wheel_speed(self, physics: mjcf.Physics, left: float, right: float) -> None:
        """Set the target speed of the wheels of each side, rad/s."""
        physics.bind(self.actuators).ctrl = left, right

    def T_world_base(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """4×4 true pose of ``base_link``."""
        base = physics.bind(self.base)
        return from_rotation(base.xmat.reshape(3, 3), base.xpos)


def _per_side(wheels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) means of the left and right pairs of a (4,) array in the order of ``WHEELS``."""
    return wheels.reshape(2, 2).mean(axis=0)


def robot_file(robot: str) -> Path:
    """Path of the MJCF of one of ``ROBOTS``; any other ``robot`` is itself a path."""
    return asset("robots", robot, f"{robot}.xml") if robot in ROBOTS else Path(robot)


@cache
def robot_model(robot: str = ROBOTS[0]) -> RobotModel:
    """Parameters of a robot for the pipeline; raises InputError as :class:`SkidSteered` does."""
    return SkidSteered(robot).model


def _filled(kind: type[Model], numbers: Mapping[str, NDArray[np.float64]], robot: str) -> Model:
    """A ``kind`` whose fields are the positive numbers of the same names."""
    values = {f.name: numbers.get(f.name, np.empty(0)) for f in fields(kind)}
    for name, value in values.items():
        if len(value) != 1 or not ((value > 0) & np.isfinite(value)).all():
            raise InputError(f'--robot {robot}: <custom> has no proper <numeric name="{name}">: {value.tolist()}')
    return kind(**{name: value.item() for name, value in values.items()})
