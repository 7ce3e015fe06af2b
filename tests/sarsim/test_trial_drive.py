"""What a few seconds of driving tell of a robot from a file."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from sarsim.arenas.load import load_arena
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.trial_drive import symptoms

AXLES = [(f'pos="{x} {y} 0.098"', f'pos="{x} {y} 0"') for x in ("0.131", "-0.131") for y in ("0.187795", "-0.187795")]
MOTORS = (
    '<velocity name="left" class="motors" joint="front_left"/>',
    '<velocity name="right" class="motors" joint="front_right"/>',
)
TORQUES = [(old, old.replace("velocity", "motor").replace(' class="motors"', ' gear="1"')) for old in MOTORS]
IMU = '<site name="imu" pos="0 0 0.0635"'
CAMERA = '<camera name="camera" xyaxes="0 -1 0 0 0 1"'
WITHOUT = 'group="3" rgba="0.4 0.5 0.9 0.4"', 'group="3" contype="0" conaffinity="0" rgba="0.4 0.5 0.9 0.4"'
RESOLUTION = """resolution="640 480" sensorsize="0.0064 0.0048"
          focalpixel="577.2953 579.4113\""""
TYRES = '<geom type="ellipsoid"', '<geom type="ellipsoid" contype="1" conaffinity="1"'


def robot(folder: Path, *pairs: tuple[str, str]) -> str:
    """The path of a Jackal in whose file some texts are replaced."""
    text = robot_file("jackal").read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    (folder / "robot.xml").write_text(text)
    return str(folder / "robot.xml")


@pytest.mark.parametrize("name", ROBOTS)
def test_the_robots_of_sarsim_have_none(name: str) -> None:
    assert symptoms(name) == []


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        ([('axis="0 1 0" armature', 'axis="0 -1 0" armature')], ["drives backwards", "turns right"]),
        (
            [
                (MOTORS[0], MOTORS[0].replace("front_left", "front_right")),
                (MOTORS[1], MOTORS[1].replace("front_right", "front_left")),
            ],
            ["turns right"],
        ),
        ([(IMU, IMU + ' euler="180 0 0"')], ["gyro is turned by 180°", "accelerometer is turned", "turns"]),
        ([(IMU, IMU + ' euler="0 0 90"')], ["gyro is turned by 90°", "accelerometer is turned"]),
        (TORQUES, ["'left' does not control a speed", "'right' does not", *[""] * 0]),
        (AXLES, [r"base_link is 0\.09\d m above"]),
        ([(CAMERA, '<camera name="camera"')], ["camera looks down by 78°"]),
        ([(CAMERA, '<camera name="camera" xyaxes="0 1 0 0 0 1"')], ["camera looks backwards"]),
        ([(CAMERA, '<camera name="camera" xyaxes="0 1 0 0 0 -1"')], ["image is turned by -?180°"]),
        ([('name="xtion" pos="0.145 0 0.55"', 'name="xtion" pos="0.08 0 0.45"')], ["covers .* image"]),
        ([(RESOLUTION, 'fovy="5"')], ["field of view is 7°"]),
        (
            [('impratio="100"/>', 'impratio="100"><flag contact="disable"/></option>')],
            ["falls through", "drives", "turns"],
        ),
        ([WITHOUT, TYRES], ["no shape of the body collides"]),
        (
            [('name="wheel_radius" data="0.0975"', 'name="wheel_radius" data="0.2"')],
            [r"drives 0\.\d+ times.*wheel_radius"],
        ),
        ([('name="length" data="0.508"', 'name="length" data="0.3"')], [r"length is 0\.3 m, .* 0\.51 m"]),
        (
            [('kv="60" ctrlrange="-25 25" forcerange="-9 9"', 'kv="60" forcerange="-0.1 0.1"')],
            [r"drives -?0\.\d+ times", r"turns -?0\.0\d times"],
        ),
    ],
    ids=[
        "reversed",
        "swapped",
        "imu",
        "imu_turned",
        "torque",
        "axle",
        "down",
        "back",
        "roll",
        "hidden",
        "view",
        "fallen",
        "ghost",
        "radius",
        "length",
        "weak",
    ],
)
def test_each_symptom_is_one_line(pairs: Sequence[tuple[str, str]], said: list[str], tmp_path: Path) -> None:
    found = symptoms(robot(tmp_path, *pairs))
    missing = [pattern for pattern in said if not any(re.search(pattern, line) for line in found)]
    assert not missing, found
    assert len(found) == len(said) or "motor" in str(pairs), found


def test_a_simulated_robot_says_its_symptoms(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = robot(tmp_path, (CAMERA, '<camera name="camera"'))
    SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(robot=path), 0).close()
    assert [f"--robot {path}: the camera looks down" in line for line in caplog.messages] == [True]
