"""What holds for every test."""

import os
import signal

from hypothesis import settings

# MuJoCo reads it when it is first imported, which a test may do before sarsim.
os.environ.setdefault("MUJOCO_GL", "egl")

# A shell that starts the tests in the background has them ignore Ctrl-C, and so the commands that they interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Compiled functions are slow the first time, and a failure must come back when the tests are run again.
settings.register_profile("sarsim", deadline=None, derandomize=True)
settings.load_profile("sarsim")
