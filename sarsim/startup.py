"""What commands and their workers set up in their process. Importing sarsim alone changes nothing in a process."""

import ctypes
import os
import stat
import tempfile
from pathlib import Path

from threadpoolctl import threadpool_limits

from sarsim.opengl import choose_platform

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of malloc.h
LARGE = 2**22
"""Allocations of at least this many bytes are returned to the system as soon as they are freed.

By default glibc raises this threshold to the size of what was freed, per thread. Fragmentation then
wastes half a gigabyte or more in a long run. A threshold of 1 MB would cost a fifth of the processor time.
"""
MAX_PIXELS = 2**26
"""Maximum size of an image file, enough for any photo. OpenCV's own limit takes gigabytes and half a minute."""


def prepare_process() -> None:
    """Set up memory, threads, images and OpenGL. Call it before OpenCV, SciPy and MuJoCo are first imported."""
    if hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(M_MMAP_THRESHOLD, LARGE)
        libc.mallopt(M_TRIM_THRESHOLD, 8 * LARGE)
        libc.mallopt(M_ARENA_MAX, 1)
    # A second thread does not speed up products as small as the pipeline's, but its busy-waiting costs a fifth of an
    # episode's processor time. OpenBLAS reads the variable when it is loaded, which NumPy has already done.
    if "OPENBLAS_NUM_THREADS" not in os.environ:
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        threadpool_limits(1, user_api="blas")
    # OpenMP's threads, as PyTorch's, would spin between two loops, which costs another tenth.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # OpenCV reads it once, when it is first imported, and rejects images whose header declares more pixels.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
    _choose_cache()
    # Rerun prints its own lines about files that cannot be written; sarsim says in one line what they mean.
    os.environ.setdefault("RUST_LOG", "warn,re_log_encoding=off,re_sdk=off")
    choose_platform()


def _choose_cache() -> None:
    """Let numba cache kernels in a temporary folder if neither this folder nor the user's own can be written.

    A user may run sarsim from another user's folder, without a home. Numba runs what it finds in the folder, so that
    it must be the user's alone.
    """
    beside, own = Path(__file__).parent, Path.home() / ".cache"
    nearest = next(folder for folder in (own, *own.parents) if folder.exists())
    if "NUMBA_CACHE_DIR" not in os.environ and not any(os.access(folder, os.W_OK) for folder in (beside, nearest)):
        folder = Path(tempfile.gettempdir(), f"sarsim-{os.getuid()}")
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
        is_own = stat.S_ISDIR(about.st_mode) and about.st_uid == os.getuid() and not about.st_mode & 0o077
        os.environ["NUMBA_CACHE_DIR"] = str(folder) if is_own else tempfile.mkdtemp(prefix="sarsim-")
