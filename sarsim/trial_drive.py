"""A short drive with a robot from the user's own file, to check whether the robot behaves as its file says."""

import logging
from collections.abc import Iterator
from contextlib import closing
from functools import lru_cache

import mujoco
import numpy as np
from dm_control import mjcf
from dm_control.rl.control import PhysicsError
from numpy.typing import NDArray

from pipeline.robot import Velocity
from pipeline.transforms import wrap_angle, yaw_of
from sarsim.arenas.arena import RescueArena
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.rendering import Renderer

HALL = """<mujoco><size nuser_geom="1"/><statistic extent="5"/><visual><map znear="0.002"/></visual><worldbody>
<light pos="0 0 4" dir="0 0 -1" directional="true"/><site name="start"/>
<geom type="plane" size="30 30 1" user="2"/><geom type="box" pos="8 0 1" size="0.1 8 1" user="1"/>
</worldbody></mujoco>"""
REST_TIME = 0.6  # s at rest before the drive
MEASURED_TIME = 0.8  # s of each drive that are measured, after the robot has reached its speed
MAX_SPEED_UP_TIME = 3.0  # Maximum time, s, that the robot is given to reach its speed
SPEED, TURN_RATE = 0.3, 1.0  # m/s and rad/s of the drives, if the robot is not slower
FALLEN_DEPTH = (
    0.3  # m; if ``base_link`` is deeper than this below the ground, the robot has fallen through the ground
)
REST_TOLERANCE = 0.02  # m, maximum distance of ``base_link`` from the ground, and maximum motion, at rest
MOTION_RATIO_RANGE = 0.75, 1.3  # Smallest and largest ratio of a motion to the command
MAX_TILT = np.radians(5)  # Maximum tilt at rest, rad
MAX_SENSOR_ROTATION = 10.0  # Maximum angle between the axes of an inertial sensor and of base_link, degrees
MAX_CAMERA_PITCH, MAX_CAMERA_ROLL = np.radians(60), np.radians(20)  # rad; the pitch may be up or down
MIN_FIELD_OF_VIEW, MAX_FIELD_OF_VIEW = 25, 130  # Usual horizontal fields of view of depth cameras, degrees
MAX_SELF_OCCLUSION = 0.25  # Maximum fraction of the image that the robot itself may cover
SIZE_TOLERANCE = 0.05  # m by which the shapes that collide may exceed the dimensions used for planning
_log = logging.getLogger(__name__)


def warn_of_symptoms(robot: str) -> None:
    """Log a warning for each symptom of a robot that sarsim does not ship; see :func:`symptoms`."""
    if robot not in ROBOTS:
        file = robot_file(robot)
        for line in _symptoms(robot, file.stat().st_mtime_ns):
            _log.warning("--robot %s: %s", robot, line)


@lru_cache(maxsize=16)
def _symptoms(robot: str, changed: int) -> tuple[str, ...]:
    """The symptoms of a robot; ``changed``, the time in ns of its file's last change, serves only as a cache key."""
    return tuple(symptoms(robot))


def symptoms(robot: str) -> list[str]:
    """The symptoms of a robot: contradictions between its behaviour and its file, one line each.

    The robot stands, takes an image, drives ahead and turns left on a level floor in front of a wall.

    Raises:
        InputError: the robot does not exist, or its file is invalid.
    """
    with closing(RescueEnvironment(RescueArena(mjcf.from_xml_string(HALL), "trial"), robot)) as world:
        trial = _Trial(world)
        found = [*trial.shapes()]
        try:
            found += trial.rest()
            found += trial.image()
            found += trial.drives()
        except PhysicsError as error:
            found.append(str(error))
    return found


class _Trial:
    """The parts of the trial; each method yields the symptoms that it finds, one line each."""

    def __init__(self, world: RescueEnvironment):
        self._world, self._robot, self._physics = world, world.robot, world.physics
        self._model, self._data = world.physics.model.ptr, world.physics.data.ptr
        root = self._model.body_rootid[world.physics.bind(world.robot.base).element_id]
        self._geoms = np.flatnonzero(self._model.body_rootid[self._model.geom_bodyid] == root)

    def shapes(self) -> Iterator[str]:
        """Symptoms in the model's motors, inertial sensors and shapes, before the robot moves."""
        model, known = self._model, self._robot.model
        for actuator in self._physics.bind(self._robot.actuators).element_id:
            is_servo = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
            if not (is_servo and model.actuator_biasprm[actuator, 2] < 0):
                name = model.actuator(actuator).name.rpartition("/")[2]
                yield f"the actuator {name!r} does not control a speed; use <velocity>, whose input is in rad/s"
        for kind in ("gyro", "accelerometer"):
            sensor = self._physics.bind(self._robot.mjcf_model.find("sensor", kind)).element_id
            turned = self._data.site_xmat[model.sensor_objid[sensor]].reshape(3, 3)
            angle = float(np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))))
            if angle > MAX_SENSOR_ROTATION:
                yield f"the site of the {kind} is turned by {angle:.0f}°; it must have the axes of base_link"
        wheels = self._physics.bind(self._robot.wheels).bodyid
        solid = self._geoms[(model.geom_contype[self._geoms] | model.geom_conaffinity[self._geoms]) > 0]
        is_wheel = np.isin(model.geom_bodyid[solid], wheels)
        if not set(wheels) <= set(model.geom_bodyid[solid]):
            yield "a wheel has no shape that collides; give each wheel's body a geom with contype and conaffinity"
        if is_wheel.all():
            yield 'no shape of the body collides, so it drives through obstacles; add geoms without contype="0"'
            return
        low, high = self._bounds(solid)
        for name, size, most in zip(
            ("length", "width", "headroom"),
            (*(high - low)[:2], high[2]),
            (known.length, known.width, known.headroom),
            strict=True,
        ):
            if size > most + SIZE_TOLERANCE:
                yield f"{name} is {most:g} m, but the shapes that collide need {size:.2f} m"

    def _bounds(self, geoms: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(3,) m each, lowest and highest world coordinates of the geoms' bounding boxes."""
        mujoco.mj_forward(self._model, self._data)
        R = self._data.geom_xmat[geoms].reshape(-1, 3, 3)
        boxes = self._model.geom_aabb[geoms]
        middle = self._data.geom_xpos[geoms] + np.einsum("nij,nj->ni", R, boxes[:, :3])
        half = np.einsum("nij,nj->ni", np.abs(R), boxes[:, 3:])
        return (middle - half).min(axis=0), (middle + half).max(axis=0)

    def rest(self) -> Iterator[str]:
        """Symptoms of a robot at rest."""
        self._drive(Velocity(), REST_TIME / 2)
        before = self._pose
        self._drive(Velocity(), REST_TIME / 2)
        T = self._pose
        height, tilt = T[2, 3], np.arccos(np.clip(T[2, 2], -1, 1))
        if height < -FALLEN_DEPTH:
            yield "the robot falls through the ground; check the contacts of its wheels"
        elif abs(height) > REST_TOLERANCE:
            place = f"{abs(height):.3f} m {'above' if height > 0 else 'below'} the ground"
            yield f"base_link is {place} when the robot stands; its origin must be on the ground between the wheels"
        if tilt > MAX_TILT:
            yield f"the robot stands tilted by {np.degrees(tilt):.0f}°; check its wheels and its centre of mass"
        if np.linalg.norm((T - before)[:2, 3]) > REST_TOLERANCE:
            yield "the robot moves although it is to stand; check its motors and the friction of its wheels"

    def image(self) -> Iterator[str]:
        """Symptoms in the camera's image."""
        renderer = Renderer(self._model)
        try:
            camera = RgbdCamera(renderer, self._robot.camera.full_identifier)
            image = camera.capture(self._data)
            geom, _ = renderer.segmentation_and_depth(self._data, camera.camera_id)
        finally:
            renderer.close()
        R = image.T_base_camera[:3, :3]
        k = image.intrinsics
        across = float(np.degrees(2 * np.arctan(k.width / 2 / k.fx)))
        if not MIN_FIELD_OF_VIEW <= across <= MAX_FIELD_OF_VIEW:
            yield f"the camera's horizontal field of view is {across:.0f}°; check fovy, or sensorsize and focal"
        pitch, yaw = np.arcsin(np.clip(-R[2, 2], -1, 1)), np.arctan2(R[1, 2], R[0, 2])
        roll = np.arctan2(-R[2, 0], -R[2, 1])
        remedy = "check the orientation of the camera, which looks along its -z with y up"
        if abs(pitch) > MAX_CAMERA_PITCH:
            yield f"the camera looks {'down' if pitch > 0 else 'up'} by {abs(np.degrees(pitch)):.0f}°; {remedy}"
        elif abs(yaw) > np.pi / 2:
            yield f"the camera looks backwards; {remedy}"
        elif abs(roll) > MAX_CAMERA_ROLL:
            yield f"the camera's image is turned by {np.degrees(roll):.0f}°; {remedy}"
        elif (own := float(np.isin(geom, self._geoms).mean())) > MAX_SELF_OCCLUSION:
            yield f"the robot covers {own:.0%} of its camera's image; move the camera out of its shapes"

    def drives(self) -> Iterator[str]:
        """Symptoms of a robot that is commanded to drive ahead and to turn left."""
        drive, known = self._robot.drive, self._robot.model
        v = min(SPEED, drive.top_speed, known.speed)
        omega = min(TURN_RATE, drive.top_turn_rate, known.turn_rate)
        before, after = self._measure(Velocity(v, 0.0), v / drive.acceleration)
        ahead = float((after - before)[:2, 3] @ before[:2, 0]) / (v * MEASURED_TIME)
        before, after = self._measure(Velocity(0.0, omega), omega / drive.turn_acceleration)
        left = wrap_angle(yaw_of(after) - yaw_of(before)) / (omega * MEASURED_TIME)
        least, most = MOTION_RATIO_RANGE
        if ahead < -least / 2:
            yield "the robot drives backwards; the axes of the wheels' joints must point to the left"
        elif not least <= ahead <= most:
            yield f"the robot drives {ahead:.2f} times as far as commanded; check wheel_radius, motors and tyres"
        if left < -least / 2:
            yield "the robot turns right when it is to turn left; the actuator left must drive the wheels with y > 0"
        elif not least <= left <= most:
            yield f"the robot turns {left:.2f} times as far as commanded; check effective_track, motors and tyres"

    def _measure(self, command: Velocity, reached: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Two 4×4 true poses, ``MEASURED_TIME`` s apart, in a drive that reaches its command after ``reached`` s."""
        self._drive(command, min(reached, MAX_SPEED_UP_TIME) + 0.2)
        before = self._pose
        self._drive(command, MEASURED_TIME)
        after = self._pose
        self._drive(Velocity(), min(reached, MAX_SPEED_UP_TIME))
        return before, after

    def _drive(self, command: Velocity, seconds: float) -> None:
        for _ in range(round(seconds / CONTROL_TIMESTEP)):
            self._world.drive(command)

    @property
    def _pose(self) -> NDArray[np.float64]:
        return self._robot.T_world_base(self._physics)
