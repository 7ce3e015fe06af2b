"""The Pioneer 3-AT as a dm_control entity."""

from functools import cached_property

import numpy as np
from dm_control import composer, mjcf
from dm_control.composer.observation import observable
from numpy.typing import NDArray

from pipeline.robot import RobotModel
from pipeline.transforms import from_rotation
from sarsim.assets import asset

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")

PIONEER_3AT = RobotModel(
    length=0.508,  # data sheet: 508 × 497 mm, wheels included
    width=0.497,
    body_height=0.3,  # top plate at 0.274 m
    headroom=0.65,  # the camera stands 0.6 m high
    max_step=0.04,  # climbs 0.10 by its data sheet; the lowest steps of stairs, 0.05, are not for driving
    max_gap=0.15,  # data sheet
    max_tilt=np.deg2rad(20),  # climbs 35 %, 19°, by its data sheet
    tipping_tilt=np.deg2rad(25),
    speed=0.2,  # the thesis's
    ramp_speed=0.15,
    turn_rate=0.8,
    ramp_turn_rate=0.4,
    acceleration=0.3,  # of its firmware
    turn_acceleration=np.deg2rad(100),
    ramp_slide=0.15,  # measured on 16°: 0.13 in a quarter turn, although it makes up for sliding
    slide_per_radian=0.42,  # measured on 16°: 0.18 in a quarter turn
    min_turn_rate=0.06,
    camera_range=(0.8, 3.5),  # the Xtion PRO LIVE's
)
"""What the pipeline knows of a Pioneer 3-AT with an Xtion on its mast."""


class Pioneer3AT(composer.Robot):
    """A P3-AT with an Xtion on its mast; attach it with ``arena.add_free_entity``."""

    def _build(self) -> None:
        self._mjcf_root = mjcf.from_path(str(asset("robots", "pioneer3at", "pioneer3at.xml")))

    def _build_observables(self) -> "Pioneer3ATObservables":
        return Pioneer3ATObservables(self)

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
        return tuple(self._mjcf_root.find("actuator", name) for name in ("left", "right"))

    @cached_property
    def camera(self) -> mjcf.Element:
        """The Xtion's camera, colour and depth alike."""
        return self._mjcf_root.find("camera", "camera")

    @cached_property
    def lamp(self) -> mjcf.Element:
        """The lamp below the Xtion, off until ``active`` is set."""
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

    def set_wheel_speed(self, physics: mjcf.Physics, left: float, right: float) -> None:
        """Order the wheels of each side to turn at this speed, rad/s."""
        physics.bind(self.actuators).ctrl = left, right

    def T_world_base(self, physics: mjcf.Physics) -> NDArray[np.float64]:
        """4×4 true pose of ``base_link``."""
        base = physics.bind(self.base)
        return from_rotation(base.xmat.reshape(3, 3), base.xpos)


class Pioneer3ATObservables(composer.Observables):
    """What the robot's own sensors tell, off until enabled."""

    @composer.observable
    def encoders(self) -> observable.Generic:
        """(4,) rad, the angle of every wheel."""
        return observable.Generic(self._entity.encoders)

    @composer.observable
    def wheel_speed(self) -> observable.Generic:
        """(2,) rad/s of the left and right wheels."""
        return observable.Generic(self._entity.wheel_speed)

    @composer.observable
    def gyro(self) -> observable.Generic:
        """(3,) rad/s in ``base_link``."""
        return observable.Generic(self._entity.gyro)

    @composer.observable
    def accelerometer(self) -> observable.Generic:
        """(3,) m/s² in ``base_link``."""
        return observable.Generic(self._entity.accelerometer)


def _per_side(wheels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) means of the left and right pairs of a (4,) array in the order of ``WHEELS``."""
    return wheels.reshape(2, 2).mean(axis=0)
