"""The simulated world: arenas, the Pioneer 3-AT, its sensors, and the ground truth that scores the robot."""

import os
from contextlib import suppress
from importlib import import_module

# Rendering needs no screen. MuJoCo reads this once, when it is first imported.
os.environ.setdefault("MUJOCO_GL", "egl")

# Mesa's driver offers the symbols of its LLVM to every library that is loaded later. Triton, which PyTorch's builds
# for CUDA bring and import when they train, would take them for those of its own LLVM and die (as in issue 124205 of
# tensorflow). Loaded before, it keeps its own. It takes 0.15 s.
with suppress(ImportError):
    import_module("triton")
