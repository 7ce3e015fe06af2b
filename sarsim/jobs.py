"""Parallel execution of independent jobs, in processes on this machine or as tasks on a Ray cluster."""

import logging
import os
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import Pipe, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, TypeVar, cast

from filelock import lock_descriptor

from pipeline.errors import InputError, required
from pipeline.files import atomic_write, uninterrupted
from pipeline.processes import usable_cores
from sarsim.startup import prepare_process

MAX_ATTEMPTS = 3  # Maximum number of attempts at a job whose workers die
CLEAN_UP_TIMEOUT = 3.0  # s for workers to clean up before they are killed
LOCK_TIMEOUT = 10.0  # s to wait for a lock; the workers of a killed command hold it until they end by themselves
LOCK_RETRY_INTERVAL = 0.05  # s between two attempts to acquire a lock
ONE_THREAD = {
    "LP_NUM_THREADS": "0",  # Of Mesa's software renderer
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
"""Environment variables that limit a worker to one core, because workers share the cores best this way."""

_log = logging.getLogger(__name__)

Job = TypeVar("Job")
Result = TypeVar("Result")
Work = Callable[[Job, Path], Result]
"""A picklable function that does a job and writes files into a folder; InputError if the job cannot be done."""
Outcomes = Generator[tuple[Job, Any, Exception | None]]
"""Yields each job when it has ended, with its result or its error; closing the generator ends the workers."""


@dataclass(frozen=True)
class FolderLock:
    """A lock on a folder, held by this process and by every worker that receives the lock, until all of them end.

    Attributes:
        folder: the locked folder.
        descriptor: the folder's descriptor, wrapped so that multiprocessing can pass it on to a worker.
    """

    folder: Path
    descriptor: Connection


Engine = Callable[[Work[Job, Any], Iterable[Job], FolderLock], Outcomes[Job]]
"""Runs jobs; their files go into the locked folder, and every process that writes there holds the lock."""


@contextmanager
def locked(folder: Path) -> Iterator[FolderLock]:
    """Lock a folder, so that only one command at a time uses it; wait until no other process holds the lock.

    Raises:
        InputError: another process holds the lock for longer than ``LOCK_TIMEOUT``.
    """
    deadline = time.monotonic() + LOCK_TIMEOUT
    with Connection(os.open(folder, os.O_RDONLY), writable=False) as descriptor:
        while not lock_descriptor(descriptor.fileno(), blocking=False):
            if time.monotonic() > deadline:
                raise InputError(
                    f"{folder}: another command is using this folder; wait until it ends, or choose another folder"
                )
            time.sleep(LOCK_RETRY_INTERVAL)
        yield FolderLock(folder, descriptor)


def make_engine(name: str = "local", workers: int | None = None) -> Engine[Any]:
    """The engine that ``--engine`` names; by default with one worker per core.

    Raises:
        InputError: Ray is not installed, or there is no cluster at ``RAY_ADDRESS``.
    """
    workers = workers or usable_cores()
    if name == "ray":
        return partial(_run_on_ray, _connect_to_ray(workers, os.environ.get("RAY_ADDRESS")), workers)
    return partial(_run_locally, workers)


def _run_locally(count: int, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job]:
    """Run jobs in processes, each with its own OpenGL context; a dead process is replaced and its job tried again."""
    todo = deque((job, 1) for job in jobs)
    workers: dict[Connection, SpawnProcess] = {}
    idle: list[Connection] = []
    running: dict[Connection, tuple[Job, int]] = {}
    try:
        while todo or running:
            # Give every worker a job. A worker that has died meanwhile is noticed below.
            while todo and len(running) < count:
                if not idle:
                    with _signals_blocked():  # Otherwise an interrupt may come before the worker is registered
                        process, pipe = start_worker(_do_jobs, lock)
                        workers[pipe] = process
                        idle.append(pipe)
                pipe = idle.pop()
                job, attempt = todo.popleft()
                running[pipe] = job, attempt
                with suppress(ConnectionError):
                    pipe.send((work, job))
            for pipe in cast(list[Connection], wait(list(running))):
                job, attempt = running.pop(pipe)
                try:
                    result, error = pipe.recv()
                except (EOFError, OSError):  # The worker died, perhaps in the middle of its answer
                    process = workers.pop(pipe)
                    _end_workers([process])
                    pipe.close()
                    if attempt < MAX_ATTEMPTS:
                        _log.warning("the worker process of job %s died; trying again", job)
                        todo.appendleft((job, attempt + 1))
                    else:
                        died = f"{attempt} worker processes died, the last one with exit status {process.exitcode}"
                        yield job, None, InputError(f"{died}; if memory is short, reduce --workers")
                else:
                    idle.append(pipe)
                    yield job, result, error
    finally:
        with uninterrupted():
            _end_workers(workers.values())


def _do_jobs(pipe: Connection, lock: FolderLock) -> None:
    """In a worker: do the jobs received through the pipe until its other end is closed, and answer each."""
    with suppress(EOFError, ConnectionError):
        while True:
            work, job = pipe.recv()
            try:
                pipe.send((_do_job(work, job, lock.folder), None))
            except (InputError, RuntimeError) as error:
                pipe.send((None, error))


def _do_job(work: Work[Job, Result], job: Job, folder: Path) -> Result:
    """Do a job in a worker; any exception but InputError becomes a RuntimeError, which can always be pickled."""
    try:
        return work(job, folder)
    except InputError:
        raise
    except Exception:
        raise RuntimeError(traceback.format_exc()) from None


def start_worker(
    function: Callable[..., object], *args: Any, environment: Mapping[str, str] = ONE_THREAD
) -> tuple[SpawnProcess, Connection]:
    """Call a function with one end of a pipe in a new process; return the process and the pipe's other end.

    The new process ends when this process ends, however that happens. Ctrl-C and a closed terminal reach only this
    process. If the new process is terminated, its clean-up code (``finally``, ``with``) runs first.
    """
    ours, theirs = Pipe()
    process = get_context("spawn").Process(target=_run_worker, args=(function, theirs, *args), daemon=True)
    before = {name: os.environ.get(name) for name in environment}
    # Otherwise multiprocessing would start its resource tracker with the first process and unblock Ctrl-C.
    resource_tracker.ensure_running()
    with _signals_blocked():
        os.environ.update(environment)
        try:
            process.start()  # The process inherits the environment and the blocked signals
        finally:
            for name, value in before.items():
                del os.environ[name]
                os.environ.update({} if value is None else {name: value})
    theirs.close()
    return process, ours


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Let Ctrl-C and a closed terminal wait until the end of the block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run_worker(function: Callable[..., object], *args: Any) -> None:
    """In a worker: call a function; SIGTERM ends the function as an exception would."""
    prepare_process()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGTERM, _clean_up_and_end)
    try:
        function(*args)
    except SystemExit:
        os._exit(1)  # Immediately, because exit handlers may take a long time
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _clean_up_and_end(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # A second SIGTERM must not cut off the clean-up
    sys.exit(1)


def _end_with_parent() -> None:
    """In a worker: end this process when its parent has ended, because a killed parent cannot end its workers."""
    required(parent_process()).join()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(CLEAN_UP_TIMEOUT)
    os._exit(1)


def _end_workers(processes: Collection[SpawnProcess]) -> None:
    """End workers; those that have not cleaned up and ended after ``CLEAN_UP_TIMEOUT`` s in total are killed."""
    deadline = time.monotonic() + CLEAN_UP_TIMEOUT
    for process in processes:
        process.terminate()
    for process in processes:
        process.join(max(0.0, deadline - time.monotonic()))
        process.kill()
        process.join()


def _connect_to_ray(workers: int, address: str | None) -> Any:
    """The module ``ray``, connected to the cluster at ``address`` or to a new one on this machine.

    Raises:
        InputError: Ray is not installed, or there is no cluster at ``address``.
    """
    try:
        import ray
    except ImportError as error:
        raise InputError("--engine ray: Ray is not installed; run: pip install 'sarsim[ray]'") from error
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    own = {"num_cpus": workers, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    options: dict[str, Any] = own if address is None else {"address": address}
    try:
        ray.init(log_to_driver=False, runtime_env={"env_vars": ONE_THREAD}, **options)
    except ConnectionError as error:
        raise InputError(
            f"RAY_ADDRESS={address}: found no Ray cluster; correct the address, or unset it to use this machine"
        ) from error
    return ray


def _run_on_ray(
    ray: Any, count: int, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock
) -> Outcomes[Job]:
    """Run jobs as tasks, which Ray restarts if their workers die; only this process writes into the folder.

    Ray's pools use actors instead of tasks, and would wait forever for an actor whose node is lost if no other node
    has room for it.
    """
    task = ray.remote(num_cpus=1, max_retries=MAX_ATTEMPTS - 1)(_do_remotely)
    todo = deque(jobs)
    shared = ray.put(work)
    running: dict[Any, Job] = {}
    try:
        while todo or running:
            while todo and len(running) < count:
                job = todo.popleft()
                running[task.remote(shared, job)] = job
            (ended,), _ = ray.wait(list(running))
            job = running.pop(ended)
            try:
                result, files = ray.get(ended)
            except ray.exceptions.RayTaskError as error:
                yield job, None, error.cause
            except ray.exceptions.RayError as error:
                yield job, None, InputError(f"a Ray worker failed: {' '.join(str(error).split())}")
            else:
                for name, content in files.items():
                    (lock.folder / name).parent.mkdir(parents=True, exist_ok=True)
                    with atomic_write(lock.folder / name) as part:
                        part.write_bytes(content)
                yield job, result, None
    finally:
        ray.shutdown()


def _do_remotely(work: Work[Job, Result], job: Job) -> tuple[Result, dict[Path, bytes]]:
    """Do a job and return its result and the contents of its files, which are not kept on the task's machine."""
    prepare_process()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result = _do_job(work, job, folder)
        files = [path for path in folder.rglob("*") if path.is_file()]
        return result, {path.relative_to(folder): path.read_bytes() for path in files}
