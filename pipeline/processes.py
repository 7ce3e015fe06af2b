"""Child processes that end with their parent, and how many processes can run at the same time."""

import ctypes
import os
import signal
from contextlib import suppress


def end_with_parent() -> None:
    """Let Linux end this process when its parent ends, even if the parent is killed (prctl's PR_SET_PDEATHSIG)."""
    with suppress(AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)


def usable_cores() -> int:
    """Number of cores that this process may use; macOS does not limit them."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
