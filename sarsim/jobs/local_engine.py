"""An engine with workers on this machine, each a process with its own OpenGL context."""

import logging
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing import connection
from multiprocessing.connection import Connection
from typing import Any

from pipeline.errors import InputError
from sarsim.jobs.engine import ATTEMPTS, Job, Outcomes, Result, Work, done, failed
from sarsim.jobs.folder_lock import FolderLock
from sarsim.jobs.processes import CLEANING, WorkerProcess, connected

_log = logging.getLogger(__name__)


class LocalEngine:
    """Runs jobs in worker processes; a worker that dies is replaced."""

    def __init__(self, workers: int):
        self._count = workers

    def run(self, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job, Result]:
        """See :class:`sarsim.jobs.engine.Engine`."""
        todo, workers = deque((job, 1) for job in jobs), [Worker(lock) for _ in range(self._count)]
        idle, running = [*workers], dict[Any, tuple[Worker, Job, int]]()
        try:
            while todo or running:
                while todo and idle:
                    worker, (job, attempt) = idle.pop(), todo.popleft()
                    running[worker.begin(work, job)] = worker, job, attempt
                for pipe in connection.wait(running):
                    worker, job, attempt = running.pop(pipe)
                    idle.append(worker)
                    outcome = worker.outcome()
                    if not isinstance(outcome.exception(), WorkerDiedError):
                        yield job, outcome
                        continue
                    status = worker.end()
                    if attempt == ATTEMPTS:
                        died = f"{attempt} worker processes died, the last one with exit status {status}"
                        yield job, failed(f"{died}; if memory is short, reduce --workers")
                    else:
                        _log.warning("the worker process of job %s died; trying again", job)
                        todo.appendleft((job, attempt + 1))
        finally:
            for worker in workers:
                worker.stop()
            for worker in workers:
                worker.end()


class WorkerDiedError(Exception):
    """The process ended before its job was done."""


class Worker:
    """Does jobs one after another in its own process, whose death affects no other worker's job."""

    def __init__(self, lock: FolderLock):
        """The process starts with the first job and holds the ``lock`` as long as it lives."""
        self._lock = lock
        self._started: tuple[WorkerProcess, Connection] | None = None

    def begin(self, work: Work[Job, Result], job: Job) -> Connection:
        """Start a job, in a new process if the last one is dead; the pipe is readable when the job has ended."""
        if self._started is None:
            self._started = connected(_serve, self._lock)
        _, pipe = self._started
        try:
            pipe.send((work, job))
        except BrokenPipeError:  # It died while idle
            self.end()
            return self.begin(work, job)
        return pipe

    def outcome(self) -> Future[Any]:
        """The outcome of the job, once it has ended; WorkerDiedError if its process died."""
        assert self._started is not None, "no job has started"
        outcome: Future[Any] = Future()
        try:
            result, error = self._started[1].recv()
        except (EOFError, ConnectionResetError):
            result, error = None, WorkerDiedError()
        outcome.set_result(result) if error is None else outcome.set_exception(error)
        return outcome

    def stop(self) -> None:
        """Let the process clean up and end."""
        if self._started is not None:
            self._started[0].terminate()

    def end(self) -> int | None:
        """End the process and return its exit code, which is negative for a signal."""
        if self._started is None:
            return None
        (process, pipe), self._started = self._started, None
        process.terminate()
        process.join(CLEANING)
        process.kill()
        process.join()
        pipe.close()
        return process.exitcode


def _serve(pipe: Connection, lock: FolderLock) -> None:
    """Do the jobs received through the pipe until its other end is closed, and send back each result or error."""
    with suppress(EOFError, BrokenPipeError):
        while True:
            work, job = pipe.recv()
            try:
                pipe.send((done(work, job, lock.folder), None))
            except (InputError, RuntimeError) as error:
                pipe.send((None, error))
