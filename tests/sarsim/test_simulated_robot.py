import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.robot import Velocity
from pipeline.sensor import XTION
from pipeline.transforms import roll_pitch_of
from sarsim.arenas.load import load_arena
from sarsim.methods.arena import make_arena
from sarsim.robots.model import robot_sensor
from sarsim.robots.names import robot_file
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from tests.sarsim.rooms import room


@pytest.fixture
def make_robot():
    robots = []

    def make(seed=0, **config):
        robots.append(SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(**config), seed))
        return robots[-1]

    yield make
    for robot in robots:
        robot.close()


def forward(robot, periods=25):
    for _ in range(periods):
        motion = robot.drive(Velocity(0.2, 0.1))
    return motion


def test_a_control_period_lasts_as_long_as_it_says(make_robot):
    robot = make_robot()
    begin = robot.time
    motion = robot.drive(Velocity())
    assert motion.time - begin == pytest.approx(robot.control_period)
    assert motion.accelerometer[2] == pytest.approx(9.81, abs=0.05)


def test_images_have_the_size_that_is_asked_for_and_the_same_view(make_robot):
    usual, wide = make_robot().sense(), make_robot(camera_size=(320, 120)).sense()
    assert wide.rgb.shape == (120, 320, 3) and wide.depth.shape == wide.label.shape == (120, 320)
    assert np.allclose(wide.intrinsics.frustum, usual.intrinsics.frustum)
    assert np.median(np.abs(wide.depth - usual.depth[2::4, 1::2])) < 0.02


def far_sighted(folder, depths="0.3 5"):
    """The file of a Jackal whose camera has another range."""
    text = robot_file("jackal").read_text()
    path = folder / "jackal.xml"
    path.write_text(text.replace("<custom>", f'<custom><numeric name="depth_range" data="{depths}"/>', 1))
    for mesh in robot_file("jackal").parent.iterdir():
        if mesh.name != path.name:
            (folder / mesh.name).symlink_to(mesh)
    return str(path)


def test_a_robots_file_says_how_far_its_camera_sees(make_robot, tmp_path):
    near, far = make_robot(robot="jackal"), make_robot(robot=far_sighted(tmp_path))
    for robot, farthest in ((near, XTION.farthest), (far, 5.0)):
        seen, true = robot.sense(), robot.true_frame
        assert farthest - 0.5 < seen.depth.max() <= farthest
        assert farthest - 0.5 < true.image.depth.max() <= farthest
        assert seen.sensor.farthest < 4 and seen.sensor == robot.sensor.precise
    assert near.sensor is XTION


@pytest.mark.parametrize("depths", ["6", "6 0.3", "0.3 80", "0 5"])
def test_a_range_of_no_camera_is_refused(depths, tmp_path):
    with pytest.raises(InputError, match=r"--robot .*depth_range"):
        robot_sensor(far_sighted(tmp_path, depths))


def test_true_odometry_is_the_true_pose_and_wheel_odometry_is_near_it(make_robot):
    truth, wheel = make_robot(odometry="truth"), make_robot(odometry="wheel")
    for robot in (truth, wheel):
        motion = forward(robot, 100)
        error = np.linalg.norm(motion.T_odom_base[:3, 3] - robot.trajectory[-1].T_world_base[:3, 3])
        assert (error == 0) == (robot is truth)
        assert error < 0.1
    start = wheel.trajectory[0]
    np.testing.assert_allclose(start.T_odom_base[:2, 3], start.T_world_base[:2, 3], atol=1e-3)


def test_odometry_knows_how_a_slope_tilts_the_robot_at_the_start():
    arena = make_arena("lanes/traverse")
    robot = SimulatedRobot(arena, SimulationConfig(), seed=0)
    pose = robot.trajectory[-1]
    robot.close()
    assert np.degrees(roll_pitch_of(pose.T_world_base)) == pytest.approx([15, 0], abs=0.2)
    assert np.degrees(roll_pitch_of(pose.T_odom_base)) == pytest.approx([15, 0], abs=0.5)


def test_vibration_in_turns_does_not_turn_the_wheel_odometry(make_robot):
    """Besides the gyro's scale error and drift, only its noise remains."""
    robot = make_robot(odometry="wheel")
    start = len(robot.trajectory)
    for step in range(200):
        robot.drive(Velocity(0.0, 0.5 if step < 100 else -0.5))
    yaw, believed = (
        np.unwrap([np.arctan2(T[1, 0], T[0, 0]) for T in poses])
        for poses in zip(*((p.T_world_base, p.T_odom_base) for p in robot.trajectory[start:]), strict=True)
    )
    causes = np.stack([yaw, np.arange(200), np.ones(200)], axis=1)
    _, unexplained, *_ = np.linalg.lstsq(causes, believed - yaw, rcond=None)
    assert np.sqrt(unexplained[0] / 200) < 3e-4


@pytest.fixture(scope="module")
def looked():
    """A robot that has taken a frame, and the frame."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), 0)
    yield robot, robot.sense()
    robot.close()


def test_a_frame_holds_what_the_camera_sees(looked):
    _, frame = looked
    assert frame.rgb.shape == (480, 640, 3)
    assert frame.depth.dtype == np.float32
    seen = frame.depth[frame.returns]
    assert seen.min() >= 0.8 and seen.max() <= 3.5
    assert {Label.WALL, Label.TERRAIN} <= set(np.unique(frame.label[frame.returns]))
    floor = frame.points(frame.T_odom_base @ frame.T_base_camera)[frame.label[frame.returns] == Label.TERRAIN]
    assert np.abs(np.median(floor[:, 2])) < 0.005


def test_the_true_frame_is_free_of_noise(looked):
    robot, frame = looked
    points = robot.true_frame.points()
    on_floor = robot.true_frame.image.label[robot.true_frame.image.depth > 0] == Label.TERRAIN
    assert np.abs(points[on_floor, 2]).max() < 2e-3
    assert not np.array_equal(frame.depth, robot.true_frame.image.depth)


def test_the_ideal_sensor_measures_the_truth(make_robot):
    robot = make_robot(sensor="ideal")
    np.testing.assert_array_equal(robot.sense().depth, robot.true_frame.image.depth)


def test_the_same_seed_drives_and_sees_the_same(make_robot):
    first, again, other = make_robot(1), make_robot(1), make_robot(2)
    frames = []
    for robot in (first, again, other):
        forward(robot)
        frames.append(robot.sense())
    np.testing.assert_array_equal(frames[0].depth, frames[1].depth)
    np.testing.assert_array_equal(frames[0].T_odom_base, frames[1].T_odom_base)
    assert not np.array_equal(frames[0].depth, frames[2].depth)


def test_running_into_a_wall_is_counted_once(make_robot):
    robot = make_robot()
    assert robot.collisions.collisions == 0
    for _ in range(round(3.5 / robot.control_period)):
        robot.drive(Velocity(-0.2))  # the west wall is 0.3 m behind
    assert robot.collisions.collisions in (1, 2)  # one or both rear tyres


@pytest.mark.parametrize("from_wall", [0.1, 0.18])
def test_a_start_at_which_the_robot_touches_a_wall_is_refused(tmp_path, from_wall):
    arena = tmp_path / "room.xml"
    arena.write_text(room((-2.0, 2.0), (-2.0, 2.0)))
    with pytest.raises(InputError, match=rf"\({from_wall - 2:g}, 0\) m; .*--start"):
        SimulatedRobot(load_arena(str(arena), (from_wall - 2, 0.0, 90.0)), SimulationConfig(), seed=0)


def test_people_are_warm_in_the_thermal_image_and_nothing_else_is(looked):
    robot, frame = looked
    thermal = frame.thermal
    shown = (robot.true_frame.image.label == Label.VICTIM).reshape(60, 8, 80, 8).any(axis=(1, 3))
    assert thermal.shape == shown.shape and thermal[shown].max() > 30
    assert thermal[~shown].max() < 20.5
