"""A skid-steered robot as a dm_control entity, defined by its MJCF alone."""

from functools import cached_property

import numpy as np
from dm_control import composer, mjcf
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.transforms import from_rotation
from sarsim.robots.model import drive_model, robot_model
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.vetting.trial import read_mjcf

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
SIDES = ("left", "right")
REQUIRED_ELEMENTS = [
    *(("body", "base_link"), ("camera", "camera"), ("light", "lamp")),
    *(("sensor", sensor) for sensor in ("gyro", "accelerometer")),
    *(("joint", wheel) for wheel in WHEELS),
    *(("actuator", side) for side in SIDES),
]
"""Kinds and names of the elements that the MJCF of a robot must have."""


FREE_JOINT_ATTRIBUTES = ("damping", "armature", "frictionloss")
"""Attributes of a free ``<joint>`` that MuJoCo's ``<freejoint>`` lacks."""


class SkidSteerRobot(composer.Robot):
    """A robot with four unsteered wheels and an RGB-D camera; use ``arena.add_free_entity`` to attach the robot.

    Attributes:
        model: parameters for the pipeline.
        drive: parameters for the firmware.
        free_joint_attributes: values of ``FREE_JOINT_ATTRIBUTES`` that the file sets for the free joint, if any.
    """

    def _build(self, robot: str = ROBOTS[0]) -> None:
        """Read the robot's MJCF.

        Args:
            robot: one of ``ROBOTS``, or the path of an MJCF file with the same names of parts and numbers.

        Raises:
            InputError: the robot does not exist, its file is invalid, or a required part or number is missing.
        """
        path = robot_file(robot)
        try:
            self._mjcf_root = read_mjcf(path)[1]
        except InputError as error:
            raise InputError(f"--robot {error}") from error
        if missing := [
            f"{kind} {name!r}" for kind, name in REQUIRED_ELEMENTS if self._mjcf_root.find(kind, name) is None
        ]:
            raise InputError(f"--robot {robot}: required elements are missing: {', '.join(missing)}")
        self.free_joint_attributes = _keep_only_robot(self._mjcf_root, self.base)
        self.model, self.drive = robot_model(robot), drive_model(robot)

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
        """(4,) rad, unwrapped angle of every wheel, in the order of ``WHEELS``."""
        return np.array(physics.bind(self.wheels).qpos)

    def wheel_speed(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(2,) rad/s, mean speeds of the left and right wheels."""
        return per_side(np.asarray(physics.bind(self.wheels).qvel))

    def wheel_angle(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(2,) rad, mean unwrapped angles of the left and right wheels."""
        return per_side(self.encoders(physics))

    def gyro(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(3,) rad/s, angular velocity in ``base_link``."""
        return np.array(physics.bind(self._mjcf_root.find("sensor", "gyro")).sensordata)

    def accelerometer(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """(3,) m/s², acceleration in ``base_link``, gravity included (+9.81 along z at rest on level ground)."""
        return np.array(physics.bind(self._mjcf_root.find("sensor", "accelerometer")).sensordata)

    def inertial_indices(self, physics: mjcf.Physics) -> NDArray[np.int64]:
        """(6,) indices of the gyro's and the accelerometer's axes in MuJoCo's ``sensordata``."""
        sensors = [physics.bind(self._mjcf_root.find("sensor", name)) for name in ("gyro", "accelerometer")]
        return np.concatenate([np.arange(3) + physics.model.sensor_adr[sensor.element_id] for sensor in sensors])

    def measurements(self, physics: mjcf.Physics) -> dict[str, NDArray[np.float64]]:
        """The measurements of the robot's own sensors, by the names of the methods that return them."""
        sensors = (self.encoders, self.wheel_speed, self.gyro, self.accelerometer)
        return {sensor.__name__: sensor(physics) for sensor in sensors}

    def T_world_base(self, physics: mjcf.Physics) -> Pose:
        """True pose of ``base_link``."""
        base = physics.bind(self.base)
        return from_rotation(base.xmat.reshape(3, 3), base.xpos)


def _keep_only_robot(root: mjcf.RootElement, base: mjcf.Element) -> dict[str, float]:
    """Keep only the robot, at the origin, and return the ``FREE_JOINT_ATTRIBUTES`` that the file's free joint sets.

    A file made for viewing a robot on its own also has a floor, lights, a free joint and a start pose.
    """
    body = base
    while body.parent is not root.worldbody:
        body = body.parent
    for other in root.worldbody.all_children():
        if other is not body:
            other.remove()
    joint = mjcf.get_freejoint(body)
    body.pos = body.quat = None
    if joint is None:
        return {}
    given = joint.get_attributes()
    joint.remove()
    return {name: given[name] for name in FREE_JOINT_ATTRIBUTES if name in given}


def per_side(wheels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) means of the left and right pairs of a (4,) array in the order of ``WHEELS``."""
    return (wheels[:2] + wheels[2:]) / 2
