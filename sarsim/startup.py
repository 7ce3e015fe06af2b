"""Set-up of the processes of commands and their workers; importing sarsim alone does not change a process."""

import ctypes
import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from threadpoolctl import threadpool_limits

from sarsim.opengl import choose_platform

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of malloc.h
LARGE_ALLOCATION = 2**22
"""Allocations of at least this many bytes are returned to the system as soon as they are freed.

By default glibc raises this threshold to the size of a freed allocation, per thread. Fragmentation then
wastes half a gigabyte or more in a long run. A threshold of 1 MB would cost a fifth of the processor time.
"""
MAX_PIXELS = 2**26
"""Maximum number of pixels of an image, enough for any photo.

An image at OpenCV's own limit takes gigabytes and half a minute.
"""


def prepare_process() -> None:
    """Set up memory, threads, images and OpenGL, before OpenCV, SciPy and MuJoCo are first imported."""
    if hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(M_MMAP_THRESHOLD, LARGE_ALLOCATION)
        libc.mallopt(M_TRIM_THRESHOLD, 8 * LARGE_ALLOCATION)
        libc.mallopt(M_ARENA_MAX, 1)
    # A second thread does not speed up matrix products as small as these, but its busy-waiting costs a fifth of an
    # episode's processor time. OpenBLAS reads the variable when it is loaded, which NumPy has already done.
    if "OPENBLAS_NUM_THREADS" not in os.environ:
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        threadpool_limits(1, user_api="blas")
    # Otherwise OpenMP's threads, such as PyTorch's, spin between two loops, which costs another tenth.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # OpenCV reads this variable at its first import, and rejects images whose header declares more pixels.
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
    _choose_cache()
    # Rerun prints its own lines about files that cannot be written, which sarsim reports in one line.
    os.environ.setdefault("RUST_LOG", "warn,re_log_encoding=off,re_sdk=off")
    choose_platform()


def _choose_cache() -> None:
    """Let numba cache kernels in a temporary folder if neither sarsim's folder nor the user's cache is writable.

    A user may run sarsim from another user's folder and have no home folder. numba runs the code that it finds in its
    cache, so the temporary folder must belong to the user alone.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    folders = [Path(__file__).parent]
    with suppress(OSError, RuntimeError):  # the user has no home folder, or may not read it
        own = Path.home() / ".cache"
        folders.append(next(folder for folder in (own, *own.parents) if folder.exists()))
    if not any(os.access(folder, os.W_OK) for folder in folders):
        folder = Path(tempfile.gettempdir(), f"sarsim-{os.getuid()}")
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
        is_own = stat.S_ISDIR(about.st_mode) and about.st_uid == os.getuid() and not about.st_mode & 0o077
        os.environ["NUMBA_CACHE_DIR"] = str(folder) if is_own else tempfile.mkdtemp(prefix="sarsim-")
