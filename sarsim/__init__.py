"""The simulated world: arenas, robots with their sensors, and the ground truth for scoring a robot."""

from contextlib import suppress
from importlib import import_module
from pathlib import Path

from pipeline.kernel_cache import PIPELINE, drop_outdated

drop_outdated([PIPELINE, Path(__file__).parent])

# Mesa's driver exports the symbols of its LLVM to all libraries loaded later. Triton, which PyTorch's CUDA builds
# import for training, crashes with them (as in tensorflow's issue 124205). If Triton is loaded first, which takes
# 0.15 s, it uses the symbols of its own LLVM.
with suppress(ImportError):
    import_module("triton")
