"""Driving by keyboard, with a viewer that needs no screen in place of MuJoCo's."""

import json
import os
import struct
import tty
from contextlib import contextmanager, nullcontext
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim import composition, teleoperation
from sarsim.arenas.load import load_arena
from sarsim.commands import teleop
from sarsim.settings import TeleopConfig
from sarsim.teleoperation import (
    DOWN,
    LEFT,
    RIGHT,
    SPACE,
    UP,
    FreeDrive,
    Gamepad,
    MappedDrive,
    Throttle,
    drive_by_keyboard,
)


def pressed(*keys):
    throttle = Throttle(max_v=0.7, max_omega=2.4)
    for key in keys:
        throttle.press(key)
    return pytest.approx((throttle.v, throttle.omega))


def test_each_press_adds_a_step_and_space_stops():
    assert pressed(UP, UP) == (0.2, 0)
    assert pressed(DOWN) == (-0.1, 0)
    assert pressed(LEFT) == (0, 0.25)
    assert pressed(RIGHT, RIGHT, RIGHT) == (0, -0.75)
    assert pressed(UP, LEFT, DOWN, RIGHT) == (0, 0)
    assert pressed(UP, UP, LEFT, SPACE) == (0, 0)
    assert pressed(UP, LEFT, ord("A")) == (0.1, 0.25)


@given(st.lists(st.sampled_from([UP, DOWN, LEFT, RIGHT, SPACE])))
def test_the_command_stays_within_the_robots_limits(keys):
    throttle = Throttle(max_v=0.7, max_omega=2.4)
    for key in keys:
        throttle.press(key)
        assert abs(throttle.v) <= 0.7
        assert abs(throttle.omega) <= 2.4


@pytest.fixture
def joystick():
    """A device that gives back what is written to it, and the path under which a gamepad is opened."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)  # or the terminal would change what looks like control characters
    yield ours, Path(os.ttyname(theirs))
    os.close(ours)
    os.close(theirs)


def js_event(value, kind, number):
    """As ``struct js_event`` of linux/joystick.h lies in memory."""
    return struct.pack("IhBB", 123456, value, kind, number)


def test_the_left_stick_of_a_gamepad_drives(joystick):
    device, path = joystick
    throttle, pad = Throttle(max_v=0.7, max_omega=2.4), Gamepad(path)
    pad.steer(throttle)  # nothing has happened
    assert (throttle.v, throttle.omega) == (0, 0)
    os.write(device, js_event(0, 0x81, 3) + js_event(-32767, 0x02, 1))  # how a button is at first; stick ahead
    pad.steer(throttle)
    assert (throttle.v, throttle.omega) == (0.7, 0)
    half = js_event(-16384, 0x02, 0)
    os.write(device, js_event(32767, 0x02, 4) + half[:5])  # the right stick; an event that comes in two parts
    pad.steer(throttle)
    assert (throttle.v, throttle.omega) == (0.7, 0)
    os.write(device, half[5:] + js_event(-32768, 0x02, 1))
    pad.steer(throttle)
    assert (throttle.v, throttle.omega) == (0.7, pytest.approx(1.2, rel=1e-3))
    os.write(device, js_event(1500, 0x02, 0) + js_event(-2000, 0x02, 1))  # let go
    pad.steer(throttle)
    assert (throttle.v, throttle.omega) == (0, 0)


def test_a_gamepad_that_is_pulled_out_stops_the_robot():
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    throttle, pad = Throttle(max_v=0.7, max_omega=2.4), Gamepad(Path(os.ttyname(theirs)))
    os.write(ours, js_event(-32767, 0x02, 1))
    pad.steer(throttle)
    assert throttle.v == 0.7
    os.close(theirs)
    os.close(ours)
    pad.steer(throttle)
    assert throttle.v == 0


class Window:
    """Stands in for the viewer's handle: up is pressed three times, and the window is closed after a second."""

    def __init__(self, press):
        self.cam = mujoco.MjvCamera()
        self.synced = 0
        self._press = press

    def is_running(self):
        if self.synced < 3:
            self._press(UP)
        return self.synced < 50

    def lock(self):
        return nullcontext()

    def sync(self):
        self.synced += 1


@pytest.fixture
def windows(monkeypatch):
    """The windows that are opened."""
    opened = []

    @contextmanager
    def launch(model, data, key_callback, **panels):
        opened.append(Window(key_callback))
        yield opened[-1]

    monkeypatch.setattr(mujoco.viewer, "launch_passive", launch)
    monkeypatch.setattr(teleoperation.time, "sleep", lambda seconds: None)
    return opened


def test_the_robot_follows_the_keys(windows):
    arena = load_arena("nist_6x4")
    drive = FreeDrive(arena)
    before = drive.physics.data.xpos[drive.base_body, 0]
    drive_by_keyboard(drive)
    # With 0.3 m/s² the 0.3 m/s are reached at the end of that second, after 0.15 m.
    driven = drive.physics.data.xpos[drive.base_body, 0] - before
    assert 0.08 < driven < 0.2
    assert windows[0].cam.trackbodyid == drive.base_body


def test_the_robot_follows_a_gamepad(windows, joystick):
    device, path = joystick
    os.write(device, js_event(32767, 0x02, 1))  # back, after the first of three presses of up
    drive = FreeDrive(load_arena("nist_6x4"))
    before = drive.physics.data.xpos[drive.base_body, 0]
    drive_by_keyboard(drive, gamepad=Gamepad(path))
    assert drive.physics.data.xpos[drive.base_body, 0] < before - 0.05


FILES = {
    "episode.rrd", "finds.json", "keyframes.npz", "metric_map.npz", "report.html", "report.json", "semantic_map.ply",
    "topology.json", "trajectory_estimated.tum", "trajectory_true.tum", "victims.csv", "victims.json",
}  # fmt: skip
"""An episode's, but for config.yaml, which its command writes."""


class Blind:
    """A detector that counts the images it is shown."""

    seen = 0

    def detect(self, rgb):
        self.seen += 1
        return []


def test_a_drive_is_mapped_and_leaves_the_files_of_an_episode(windows, tmp_path, monkeypatch):
    detector = Blind()
    monkeypatch.setattr(composition, "make_perception", lambda config: (TruthClassifier(), detector))
    drive = MappedDrive(TeleopConfig(), load_arena("nist_6x4"), tmp_path)
    first = drive.physics.data.xpos[drive.base_body, 0]
    drive_by_keyboard(drive)
    last = drive.physics.data.xpos[drive.base_body, 0]
    drive.save()
    assert {path.name for path in tmp_path.iterdir()} == FILES
    assert len(drive.mapper.keyframes) == detector.seen >= 2
    assert np.ptp(drive.mapper.keyframes.poses[:, 0, 3]) == pytest.approx(last - first, abs=0.25)
    assert {1, 2} <= set(drive.mapper.semantic_map.labels().tolist())
    assert json.loads((tmp_path / "topology.json").read_text())["nodes"]
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["localisation"]["keyframes"] == report["steps"] == detector.seen
    assert 0.05 < report["exploration"]["explored_fraction"] < 0.9
    assert report["navigation"]["distance_m"] == pytest.approx(last - first, abs=0.05)
    assert "Unseen ground was not searched for" in (tmp_path / "report.html").read_text()


class Unstable(MappedDrive):
    """A drive without a Rerun window, whose physics diverge at the first command."""

    def __init__(self, config, arena, out, is_shown):
        super().__init__(config, arena, out)

    def drive(self, command):
        self.physics.data.qvel[0] = 1e12
        super().drive(command)


@pytest.mark.usefixtures("windows")
def test_an_unstable_simulation_leaves_the_map_made_so_far(tmp_path, monkeypatch):
    monkeypatch.setattr(composition, "make_perception", lambda config: (TruthClassifier(), Blind()))
    monkeypatch.setattr(teleop, "check_display", lambda: None)
    monkeypatch.setattr(teleoperation, "MappedDrive", Unstable)
    with pytest.raises(InputError, match="unstable"):
        teleop.teleop(TeleopConfig(out=tmp_path / "map"))
    assert {path.name for path in (tmp_path / "map").iterdir()} == FILES
