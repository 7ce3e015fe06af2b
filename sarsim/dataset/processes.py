"""Child processes."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

ONE_THREAD = {
    "LP_NUM_THREADS": "0",  # for Mesa's software renderer
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
"""Environment of a worker: workers share the cores best if each keeps to one."""


def start(function: Callable[..., object], *args: Any, environment: Mapping[str, str] = ONE_THREAD) -> BaseProcess:
    """Call a function in a new process, which ends with this one, however this one ends.

    By default its environment limits it to one thread. It leaves Ctrl-C and a closed terminal to this process, and
    runs its clean-up code (``finally``, ``with``) when SIGTERM ends it.
    """
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=_call, args=(function, args), daemon=True)
    with _environment(environment), _ignored_interrupts():
        process.start()
    return process


def connected(
    function: Callable[..., object], *args: Any, environment: Mapping[str, str] = ONE_THREAD
) -> tuple[BaseProcess, Connection]:
    """Call a function in a new process as :func:`start` does, with one end of a pipe as its first argument."""
    ours, theirs = multiprocessing.Pipe()
    process = start(function, theirs, *args, environment=environment)
    theirs.close()
    return process, ours


def _call(function: Callable[..., object], args: tuple[Any, ...]) -> None:
    """The main function of the new process."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        function(*args)
    finally:  # nothing is left to clean up, and what Python does at its end must not raise
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end_with_parent() -> None:
    """End this process when its parent has ended, because a killed parent cannot do that."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def _environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables, which a process that is started within the context inherits."""
    before = {name: os.environ[name] for name in values if name in os.environ}
    os.environ.update(values)
    try:
        yield
    finally:
        for name in values:
            del os.environ[name]
        os.environ.update(before)


@contextmanager
def _ignored_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C and a closed terminal, also in a process that is started within the context."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
