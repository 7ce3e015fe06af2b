"""The simulated world: arenas, the Pioneer 3-AT, its sensors, and the ground truth that scores the robot."""

import os

# Rendering needs no screen. MuJoCo reads this once, when it is first imported.
os.environ.setdefault("MUJOCO_GL", "egl")
