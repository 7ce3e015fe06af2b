"""The simulated world: arenas, the Pioneer 3-AT, its sensors, and the ground truth that scores the robot."""

import os
from contextlib import suppress
from importlib import import_module

# Rendering needs no screen. MuJoCo reads this once, when it is first imported.
os.environ.setdefault("MUJOCO_GL", "egl")

# Mesa's driver offers its LLVM's symbols to all libraries loaded later, and triton, which PyTorch's builds for CUDA
# import when they train, dies on them (as in tensorflow's issue 124205). Loaded before, in 0.15 s, it keeps its own.
with suppress(ImportError):
    import_module("triton")
