"""The teleop command, as far as it runs without a screen."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sarsim.commands.settings import run_with_settings
from sarsim.commands.teleop import teleop
from sarsim.settings import TeleopConfig
from tests.refusal import refusal

TELEOP = Path(__file__).parents[3] / "scripts" / "teleop.py"
NO_DISPLAY = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        ((), "DISPLAY"),
        (("--arena", "atlantis"), "unknown arena 'atlantis'"),
        (("--arena", "random:x"), "the seed must be a non-negative integer"),
        (("--gamepad", "/dev/input/js99"), "No such file"),
        (("--gamepad", __file__), "must be a joystick device"),
    ],
)
def test_what_cannot_work_ends_with_one_line_and_status_2(flags, reason, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert reason in refusal(capsys, run_with_settings, teleop, TeleopConfig, flags)


@pytest.mark.display
@pytest.mark.skipif(not shutil.which("xvfb-run"), reason="no Xvfb")
def test_ctrl_c_ends_it_while_the_window_is_open():
    with subprocess.Popen(
        ["xvfb-run", "-a", "--server-args=-screen 0 640x480x24", sys.executable, TELEOP],
        env=NO_DISPLAY | {"MUJOCO_GL": "glfw"},
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        while "Close the window" not in process.stdout.readline():
            pass
        time.sleep(5)
        (teleop,) = subprocess.check_output(["pgrep", "-s", str(process.pid), "-f", str(TELEOP.name)]).split()[-1:]
        os.kill(int(teleop), signal.SIGINT)
        assert process.wait(timeout=30) == 130
