"""The robots that come along, and how they drive; run with -s to see the figures."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from dm_control import composer, mjcf
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.robot import Motion, Velocity
from pipeline.transforms import from_rotation, inverse, roll_pitch_of, wrap_angle, yaw_of
from sarsim.robots.model import robot_model
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.robots.skid_steer import SkidSteerController
from sarsim.robots.skid_steered import WHEELS, SkidSteerRobot
from sarsim.sensors.odometry import WheelOdometry
from tests.pipeline.navigation.follower import Follower
from tests.sarsim.sensors.no_noise import NoNoise


@dataclass(frozen=True)
class Sheet:
    """What the sources say of a robot: kg and m."""

    mass: float
    size: tuple[float, float]
    axle: tuple[float, float, float]
    camera: tuple[float, float, float]
    rolling: float
    lid: tuple[str, float]
    sweep: float
    """m that its centre moves at most in a turn; a robot with its load in front turns about a point in front."""


SHEETS = {
    "pioneer3at": Sheet(
        12.0, (0.508, 0.497), (0.135, 0.199, 0.111), (0.17, 0, 0.6), 0.1105, ("top_plate", 0.274), 0.05
    ),
    "jackal": Sheet(
        16.523 + 4 * 0.477 + 0.4,
        (0.508, 0.43),
        (0.131, 0.187795, 0.098),
        (0.145, 0, 0.55),
        0.0975,
        ("lid", 0.2475),
        0.09,
    ),
}


@pytest.fixture(params=ROBOTS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


CONTROL = 0.02
LENGTH, RISE = 0.59, 0.17


class Track(composer.Arena):
    """Terrain, and across it a ridge: a half ramp up from x = 1 m, a deck of 1.2 m, a half ramp down."""

    def _build(self) -> None:
        self._mjcf_root = root = mjcf.RootElement("track")
        corners = [(x, y, z) for x, z in ((0, 0), (LENGTH, 0), (LENGTH, RISE)) for y in (-0.6, 0.6)]
        root.asset.add("mesh", name="up", vertex=np.ravel(corners))
        root.asset.add("mesh", name="down", vertex=np.ravel([(-x, y, z) for x, y, z in corners]))
        add = root.worldbody.add
        add("geom", type="plane", size=(0, 0, 0.1))
        add("geom", type="mesh", mesh="up", pos=(1, 0, 0))
        add("geom", type="box", size=(0.6, 0.6, RISE / 2), pos=(1.6 + LENGTH, 0, RISE / 2))
        add("geom", type="mesh", mesh="down", pos=(2.2 + 2 * LENGTH, 0, 0))


class Slope(composer.Arena):
    """A plane that rises by so many degrees towards +x."""

    def _build(self, degrees: float = 19) -> None:
        self._mjcf_root = mjcf.RootElement("slope")
        angle = np.radians(degrees)
        normal = (-np.sin(angle), 0, np.cos(angle))
        self._mjcf_root.worldbody.add("geom", type="plane", size=(0, 0, 0.1), zaxis=normal)


class Wall(composer.Arena):
    """Terrain, and a wall across it at x = 1.1 m."""

    def _build(self) -> None:
        self._mjcf_root = mjcf.RootElement("wall")
        add = self._mjcf_root.worldbody.add
        add("geom", type="plane", size=(0, 0, 0.1))
        add("geom", type="box", size=(0.1, 5, 0.6), pos=(1.2, 0, 0.6))


class Drive:
    """The robot in an arena, its firmware and odometry, and its true poses along the way."""

    def __init__(self, name: str, arena: composer.Arena, x: float = 0.0, z: float = 0.0, pitch: float = 0.0) -> None:
        self.robot = SkidSteerRobot(name)
        arena.add_free_entity(self.robot)
        self.physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
        with self.physics.reset_context():
            self.robot.set_pose(self.physics, (x, 0, z), (np.cos(pitch / 2), 0, np.sin(pitch / 2), 0))
        self.firmware = SkidSteerController(self.robot.drive)
        self.odometry = WheelOdometry(NoNoise(), self.robot.drive.wheel_radius)
        self.poses: list[NDArray[np.float64]] = []
        self.turned = 0.0
        self.go(1.0)
        self.start, self.poses, self.turned = self.pose, [self.pose], 0.0
        self.odometry_start = self.odometry.T_odom_base

    @property
    def pose(self) -> NDArray[np.float64]:
        return self.robot.T_world_base(self.physics)

    @property
    def moved(self) -> NDArray[np.float64]:
        """4×4 pose in the frame of the start."""
        return inverse(self.start) @ self.pose

    @property
    def tilt(self) -> float:
        """The largest roll or pitch so far, degrees."""
        return float(np.degrees(np.abs([roll_pitch_of(T) for T in self.poses]).max()))

    @property
    def strayed(self) -> float:
        """The largest distance from the start so far, m."""
        return max(float(np.linalg.norm((T - self.start)[:3, 3])) for T in self.poses)

    def go(self, seconds: float, v: float = 0.0, omega: float = 0.0) -> "Drive":
        """Drive at a commanded velocity; any warning of the physics fails the test."""
        for _ in range(round(seconds / CONTROL)):
            self._step(Velocity(v, omega))
        assert not self.physics.data.warning.number.any()
        return self

    def _step(self, velocity: Velocity) -> None:
        robot, physics, yaw = self.robot, self.physics, yaw_of(self.pose)
        wheels = self.firmware.command(velocity, robot.wheel_speed(physics), robot.gyro(physics)[2], CONTROL)
        physics.bind(robot.actuators).ctrl = wheels
        physics.step(round(CONTROL / physics.timestep()))
        self.odometry.update(robot.wheel_angle(physics), robot.gyro(physics), robot.accelerometer(physics), CONTROL)
        self.turned += wrap_angle(yaw_of(self.pose) - yaw)
        self.poses.append(self.pose)


def on_track(name: str = ROBOTS[0], **start: float) -> Drive:
    return Drive(name, Track(), **start)


@pytest.mark.parametrize("part", ["model", "scene"])
def test_opens_in_mujoco(name, part):
    path = robot_file(name)
    model = mujoco.MjModel.from_xml_path(str(path if part == "model" else path.with_name("scene.xml")))
    assert_allclose(model.body_mass.sum(), SHEETS[name].mass)
    assert model.nu == 2
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == 100
    assert not model.geom_user.any()


def test_rolls_in_its_scene(name):
    model = mujoco.MjModel.from_xml_path(str(robot_file(name).with_name("scene.xml")))
    data = mujoco.MjData(model)
    data.ctrl[:] = 2.0
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    assert_allclose(data.qpos[:2], [2.0 * SHEETS[name].rolling * 2.0, 0.0], atol=0.02)


def test_scene_and_model_have_the_same_physics(name):
    paths = robot_file(name), robot_file(name).with_name("scene.xml")
    options = [ET.parse(path).getroot().find("option").attrib for path in paths]
    assert options[0] == options[1]


def test_size_is_the_data_sheets(name):
    model, data = at_rest(name)
    low, high = _bounds(model, data)
    assert_allclose((high - low)[:2], SHEETS[name].size, atol=0.001)
    assert_allclose((robot_model(name).length, robot_model(name).width), SHEETS[name].size)
    assert_allclose(low[2], 0.0, atol=1e-6)
    assert high[2] <= robot_model(name).headroom
    lid, height = SHEETS[name].lid
    assert_allclose(_corners(model, data, model.geom(lid).id)[:, 2].max(), height, atol=1e-4)
    assert height < robot_model(name).body_height


def test_wheels_stand_where_the_sources_say(name):
    _, data = at_rest(name)
    axles = np.array([data.body(f"{wheel}_wheel").xpos for wheel in WHEELS])
    assert_allclose(np.abs(axles), np.tile(SHEETS[name].axle, (4, 1)))
    assert_allclose(np.sign(axles[:, :2]), [[1, 1], [1, -1], [-1, 1], [-1, -1]])


def test_the_effective_track_follows_from_the_wheels(name):
    x, y, _ = SHEETS[name].axle
    assert_allclose(SkidSteerRobot(name).drive.effective_track, 2 * y + (2 * x) ** 2 / (2 * y), atol=1e-3)


def test_camera_is_an_xtion_on_the_mast(name):
    drive = on_track(name)
    camera = drive.physics.bind(drive.robot.camera)
    T_world_camera = from_rotation(np.reshape(camera.xmat, (3, 3)) @ np.diag([1, -1, -1]), camera.xpos)
    T = inverse(drive.pose) @ T_world_camera
    assert_allclose(T[:3, 3], SHEETS[name].camera, atol=1e-6)
    assert_allclose(T[:3, 2], [np.cos(np.radians(12)), 0, -np.sin(np.radians(12))], atol=1e-6)
    half_width, half_height = np.divide([320, 240], drive.robot.camera.focalpixel)
    assert_allclose(2 * np.degrees(np.arctan([half_width, half_height])), [58, 45], atol=1e-4)
    assert drive.physics.bind(drive.robot.lamp).active == 0


def test_camera_does_not_see_the_robot(name):
    model, data = at_rest(name)
    R = data.cam("camera").xmat.reshape(3, 3)
    tan_x, tan_y = np.tan(np.radians([29, 22.5]))
    hit = np.zeros(1, np.int32)
    for x in np.linspace(-tan_x, tan_x, 25):
        for y in np.linspace(-tan_y, tan_y, 25):
            ray = R @ (np.array([x, y, -1.0]) / np.linalg.norm([x, y, 1.0]))
            assert mujoco.mj_ray(model, data, data.cam("camera").xpos, ray, None, 1, -1, hit) == -1


def test_stands_level_and_still(name):
    drive = on_track(name).go(2.0)
    assert_allclose(drive.robot.accelerometer(drive.physics), [0, 0, 9.81], atol=1e-3)
    assert_allclose(drive.pose[2, 3], 0.0, atol=0.0015)
    assert drive.strayed < 1e-4


def test_belts_keep_the_wheels_of_a_side_together(name):
    drive = on_track(name).go(5.0, 0.3, 0.5)
    front_left, front_right, rear_left, rear_right = drive.robot.encoders(drive.physics)
    assert_allclose([rear_left, rear_right], [front_left, front_right], atol=0.01)


def test_drives_two_metres_straight(name):
    drive = on_track(name, x=-5).go(10.0, 0.2).go(2.0)
    forward, sideways = drive.moved[:2, 3]
    print(f"\n2 m at 0.2 m/s: {forward:.4f} m forward, {1000 * sideways:.2f} mm sideways")
    assert abs(sideways) <= 0.02
    assert_allclose(forward, 2.0, atol=0.01)


@pytest.mark.parametrize("rate", [1.0, -0.5])
def test_turns_in_place(name, rate):
    drive = on_track(name, x=-5).go(2 * np.pi / abs(rate), 0.0, rate).go(2.0)
    turned = np.degrees(abs(drive.turned))
    print(f"\n360° at {rate} rad/s: {turned:.2f}°, never {1000 * drive.strayed:.0f} mm away")
    assert_allclose(turned, 360, atol=3)
    assert drive.strayed < SHEETS[name].sweep
    assert np.linalg.norm(drive.moved[:2, 3]) < 0.01


def test_reaches_its_top_speed(name):
    speed = SkidSteerRobot(name).drive.top_speed
    drive = Drive(name, Slope(0)).go(5.0 if speed < 1 else 6.0, speed)
    speed = np.linalg.norm((drive.poses[-1] - drive.poses[-51])[:3, 3])
    print(f"\ntop speed: {speed:.3f} m/s")
    assert_allclose(speed, drive.robot.drive.top_speed, rtol=0.015)


def test_climbs_and_descends_a_ridge_and_its_odometry_without_errors_agrees_with_the_truth(name):
    drive = on_track(name)
    tyres = {drive.physics.model.name2id(f"{name}/{wheel}_tyre", "geom") for wheel in WHEELS}
    arena = set(np.flatnonzero(drive.physics.model.geom_bodyid == 0))
    touching: set[int] = set()
    for _ in range(1100):
        touching |= set(drive.go(CONTROL, 0.2).physics.data.contact.geom.ravel())
    drive.go(1.0)
    assert touching - arena == tyres  # the chassis clears it
    assert max(T[2, 3] for T in drive.poses) > RISE - 0.005
    assert drive.pose[0, 3] > 2.2 + 2 * LENGTH + 0.4
    assert abs(drive.moved[1, 3]) < 0.02
    assert drive.tilt < 17
    drive.go(3.0, 0.2, 0.5).go(4.0, 0.2)
    believed = inverse(drive.odometry_start) @ drive.odometry.T_odom_base
    error = np.linalg.norm(believed[:3, 3] - drive.moved[:3, 3])
    print(f"\nodometry without errors, over a ridge of 16.1° and round a bend, 5.8 m: {1000 * error:.0f} mm")
    assert error < 0.03 + SHEETS[name].sweep
    assert_allclose(yaw_of(believed), yaw_of(drive.moved), atol=np.radians(0.5))


def test_stops_on_a_ramp_and_stays(name):
    drive = on_track(name).go(1.3 / 0.15, 0.15).go(1.5)
    assert_allclose(np.degrees(roll_pitch_of(drive.pose)[1]), -16.1, atol=0.3)
    stopped = drive.pose
    drive.go(10.0)
    assert np.linalg.norm((drive.pose - stopped)[:3, 3]) < 0.01


def test_climbs_the_steepest_slope_of_the_data_sheet(name):
    drive = Drive(name, Slope(), z=0.002, pitch=-np.radians(19)).go(4.0, 0.25)
    assert_allclose(
        np.linalg.norm(drive.moved[:3, 3]), 0.25 * 4.0 - 0.25**2 / 2 / drive.robot.drive.acceleration, atol=0.02
    )


@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_does_not_climb_a_wall(name, angle):
    drive = Drive(name, Wall()).go(angle / 0.5, 0.0, 0.5).go(1.0).go(8.0, 0.2)
    assert drive.tilt < 2


def test_same_commands_give_the_same_run():
    first, second = (on_track().go(2.0, 0.2, 0.5).pose for _ in range(2))
    assert np.array_equal(first, second)


def at_rest(name) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The model alone, as its file has it."""
    model = mujoco.MjModel.from_xml_path(str(robot_file(name)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize(
    ("old", "new", "wrong"),
    [
        ('<joint name="front_left" ', '<joint name="left_front" ', "unknown element 'front_left'"),
        ('name="lamp"', 'name="torch"', "required elements are missing: light 'lamp'"),
        ('<numeric name="max_gap" data="0.15"/>', "", '<numeric name="max_gap"> .* from 0.001 to 10; found none'),
        ('name="length" data="0.508"', 'name="length" data="-1"', r"length\"> .* from 0.001 to 10; found -1$"),
        ('name="length" data="0.508"', 'name="length" data="0.5 0.5"', r"length\"> .*; found 0.5 0.5$"),
        ("<worldbody>", "<worldbody", "cannot be parsed as XML: "),
        ("<worldbody>", '<include file="bad.xml"/><worldbody>', "already included"),
        ('class="wheel"/>', 'class="nope"/>', "unknown default class name 'nope'"),
        ('mass="7.2"', 'mass="-1"', "mass, inertia or density are negative"),
        ('timestep="0.002"', 'timestep="0"', "timestep must be from 0.0001 to 0.02, not 0"),
        ('timestep="0.002"', 'iterations="2000000000"', "iterations must be from 0 to 1000, not 2e.09"),
        ("<asset>", '<asset><hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/>', "more than 1 GB"),
        ("<asset>", '<asset><mesh file="/dev/zero"/>', "outside its folder"),
        (
            "<site ",
            '<replicate count="100000"><geom size=".1"/></replicate><site ',
            r"has 1000\d\d geoms, including copies",
        ),
    ],
)
def test_a_file_that_is_no_robot_is_refused(tmp_path, old, new, wrong):
    bad, text = tmp_path / "bad.xml", robot_file(ROBOTS[0]).read_text()
    assert old in text
    bad.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=wrong):
        SkidSteerRobot(str(bad))


def test_a_robot_is_a_name_or_a_file(tmp_path):
    path = tmp_path / "own.xml"
    path.write_text(robot_file(ROBOTS[0]).read_text())
    assert robot_model(str(path)) == robot_model()
    with pytest.raises(InputError, match=r"--robot pioneer: .*pioneer3at, jackal or the path"):
        SkidSteerRobot("pioneer")


def _corners(model, data, geom) -> NDArray[np.float64]:
    """(N, 3) vertices of a mesh geom, or corners of the box around any other, in the world."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
    else:
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        points = model.geom_aabb[geom, :3] + signs * model.geom_aabb[geom, 3:]
    return points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def _bounds(model, data) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The box around all geoms except the lugs, whose corners protrude a little."""
    geoms = [geom for geom in range(model.ngeom) if model.geom_matid[geom] != model.material("lug").id]
    points = np.concatenate([_corners(model, data, geom) for geom in geoms])
    return points.min(axis=0), points.max(axis=0)


class Body:
    """A drive with the interface of a robot, for the navigator; it has no camera."""

    control_period = CONTROL

    def __init__(self, drive: Drive) -> None:
        self._drive, self.model = drive, replace(drive.robot.model, speed=0.2)

    def sense(self) -> Frame:
        raise NotImplementedError

    def drive(self, command: Velocity) -> Motion:
        drive = self._drive.go(CONTROL, command.v, command.omega)
        robot, physics = drive.robot, drive.physics
        felt = robot.gyro(physics), robot.accelerometer(physics), robot.wheel_speed(physics)
        return Motion(physics.data.time, drive.pose, *felt)


def strays(name: str, first: float, last: float, hold_gain: float) -> float:
    """m that the robot moves at most when it turns from one heading to another, degrees, on a slope of 16°."""
    drive = Drive(name, Slope(16), z=0.2, pitch=-np.radians(16))
    follower, here = Follower(Body(drive), hold_gain), drive.pose[:2, 3]
    assert follower.drive(here[None], np.radians(first))
    drive.start, drive.poses = drive.pose, []
    assert follower.drive(drive.pose[None, :2, 3], np.radians(last))
    assert abs(wrap_angle(yaw_of(drive.pose) - np.radians(last))) < np.radians(4)
    return drive.strayed


@pytest.mark.parametrize(("first", "last"), [(0, 90), (180, 90)])
def test_it_makes_up_for_sliding_down_a_ramp_that_it_turns_on(name: str, first: float, last: float) -> None:
    held, free = (strays(name, first, last, gain) for gain in (1.0, 0.0))
    print(f"{first}° to {last}° on 16°: strays {held:.3f} m, {free:.3f} m if it lets itself slide")
    assert held < 0.14
    assert held < 0.8 * free
