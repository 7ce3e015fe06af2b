"""A lock that allows one generator at a time in a folder."""

import fcntl
import os
import time
from collections.abc import Callable
from contextlib import ExitStack
from multiprocessing import reduction
from pathlib import Path
from typing import Any, Self

from pipeline.errors import InputError

LOCK_PATIENCE = 10.0  # s to wait for the workers of a generator that was killed; they end by themselves


class FolderLock(ExitStack):
    """A lock held by this process and by every process that it is sent to, until the last of them has ended."""

    def __init__(self, descriptor: int):
        super().__init__()
        self._descriptor = descriptor
        self.callback(os.close, descriptor)

    @classmethod
    def take(cls, folder: Path) -> Self:
        """Take the lock of a folder; waits until no other process holds it.

        Raises:
            InputError: another process holds it for longer than ``PATIENCE``.
        """
        descriptor = os.open(folder, os.O_RDONLY)
        deadline = time.monotonic() + LOCK_PATIENCE
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return cls(descriptor)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    os.close(descriptor)
                    raise InputError(f"{folder}: another process is generating here") from None
                time.sleep(0.05)

    def __reduce__(self) -> tuple[Callable[..., "FolderLock"], tuple[Any]]:
        # A duplicate of the descriptor is the same lock.
        return _received, (reduction.DupFd(self._descriptor),)


def _received(duplicate: Any) -> FolderLock:
    return FolderLock(duplicate.detach())
