"""The teleop command, as far as it runs without a screen."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

TELEOP = Path(__file__).parents[3] / "scripts" / "teleop.py"
NO_DISPLAY = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}


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
