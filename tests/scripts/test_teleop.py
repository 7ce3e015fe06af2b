"""The teleop command, as far as it goes without a screen."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

TELEOP = Path(__file__).parents[2] / "scripts" / "teleop.py"
NO_DISPLAY = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        ((), "no display"),
        (("--arena", "atlantis"), "unknown arena 'atlantis'"),
        (("--arena", "missing.xml"), "missing.xml"),
        (("--arena", "random:x"), "whole number"),
    ],
)
def test_what_cannot_work_ends_with_one_line_and_status_2(flags, reason):
    done = subprocess.run([sys.executable, TELEOP, *flags], env=NO_DISPLAY, capture_output=True, text=True)
    assert done.returncode == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
