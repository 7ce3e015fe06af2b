"""Child processes."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import Pipe, parent_process, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, TypeVar

Result = TypeVar("Result")

ONE_THREAD = {
    "LP_NUM_THREADS": "0",  # Of Mesa's software renderer
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
"""Environment of a worker: workers share the cores best if each uses only one."""
CLEANING = 5.0  # s for a process to clean up before it is killed


class WorkerProcess(SpawnProcess):
    """A process that ends when this one ends, for whatever reason."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs, daemon=True)

    def run(self) -> None:
        """Do the work; called in the new process."""
        threading.Thread(target=_end_with_parent, daemon=True).start()
        super().run()


def tidily(function: Callable[..., Result], *args: Any) -> Result:
    """Call a function. If SIGTERM ends the process meanwhile, clean-up code (``finally``, ``with``) runs first."""
    signal.signal(signal.SIGTERM, _clean_up_and_end)
    try:
        return function(*args)
    except SystemExit:  # At once, because exit handlers may take long
        os._exit(1)
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _clean_up_and_end(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # A second SIGTERM must not cut off the clean-up
    sys.exit(1)


def connected(
    function: Callable[..., object], *args: Any, environment: Mapping[str, str] = ONE_THREAD
) -> tuple[WorkerProcess, Connection]:
    """Call a function in a new process with one end of a pipe as its first argument; return the other end."""
    ours, theirs = Pipe()
    process = WorkerProcess(target=tidily, args=(function, theirs, *args))
    with _starting(environment):
        process.start()
    theirs.close()
    return process, ours


@contextmanager
def _starting(environment: Mapping[str, str]) -> Iterator[None]:
    """Start processes in the block with an environment; Ctrl-C and a closed terminal then affect this process only.

    The processes inherit a mask that blocks these signals; one sent meanwhile reaches this process after the block.
    """
    resource_tracker.ensure_running()  # Else multiprocessing starts it with the first process and unblocks Ctrl-C
    before = {name: os.environ.get(name) for name in environment}
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    os.environ.update(environment)
    try:
        yield
    finally:
        for name, value in before.items():
            del os.environ[name]
            os.environ.update({} if value is None else {name: value})
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _end_with_parent() -> None:
    """End this process when its parent has ended, since a killed parent cannot end it."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(CLEANING)
    os._exit(1)
