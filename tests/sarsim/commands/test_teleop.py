"""The teleop command, as far as it runs without a screen."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sarsim.commands.cli import run
from sarsim.commands.teleop import teleop
from tests.refusal import refusal

TELEOP = Path(__file__).parents[3] / "scripts" / "teleop.py"
NO_DISPLAY = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}


def test_without_a_display_it_ends_with_one_line_and_status_2():
    done = subprocess.run([sys.executable, TELEOP], env=NO_DISPLAY, capture_output=True, text=True)
    assert done.returncode == 2
    assert "no display" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        (("--arena", "atlantis"), "unknown arena 'atlantis'"),
        (("--arena", "missing.xml"), "missing.xml"),
        (("--arena", "random:x"), "whole number"),
        (("--gamepad", "/dev/input/js99"), "No such file"),
        (("--gamepad", __file__), "not a device"),
    ],
)
def test_what_cannot_work_ends_with_one_line_and_status_2(flags, reason, capsys):
    assert reason in refusal(capsys, run, teleop, flags)


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
