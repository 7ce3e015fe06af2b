"""A lock that allows one command at a time in a folder."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import reduction
from pathlib import Path
from typing import Any

from filelock import lock_descriptor

from pipeline.errors import InputError

PATIENCE = 10.0  # s to wait for the workers of a killed command, which end by themselves
PAUSE = 0.05  # s between two attempts to acquire the lock


@dataclass(frozen=True)
class FolderLock:
    """A lock held by this process and by every worker that receives it, until the last of them has ended.

    Attributes:
        folder: the locked folder.
        descriptor: file descriptor of the folder; duplicates of it hold the same lock.
    """

    folder: Path
    descriptor: int

    def __reduce__(self) -> tuple[Callable[..., "FolderLock"], tuple[Any, ...]]:
        return _received, (self.folder, reduction.DupFd(self.descriptor))


def _received(folder: Path, duplicate: Any) -> FolderLock:
    return FolderLock(folder, duplicate.detach())


@contextmanager
def locked(folder: Path) -> Iterator[FolderLock]:
    """Lock a folder, waiting until no other process holds the lock.

    Raises:
        InputError: another process holds the lock for longer than ``PATIENCE``.
    """
    descriptor, deadline = os.open(folder, os.O_RDONLY), time.monotonic() + PATIENCE
    try:
        while not lock_descriptor(descriptor, blocking=False):
            if time.monotonic() > deadline:
                raise InputError(
                    f"{folder}: another command is using this folder; wait until it ends, or choose another folder"
                )
            time.sleep(PAUSE)
        yield FolderLock(folder, descriptor)
    finally:
        os.close(descriptor)
