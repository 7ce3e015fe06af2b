"""An engine with workers on this machine, each a process with its own OpenGL context."""

import logging
from collections import deque
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from sarsim.jobs.engine import ATTEMPTS, Job, Outcomes, Result, Work, done, failed
from sarsim.jobs.folder_lock import FolderLock
from sarsim.jobs.processes import CLEANING, WorkerContext, starting, tidily

_log = logging.getLogger(__name__)


class LocalEngine:
    """Does jobs in worker processes; one that dies is replaced."""

    def __init__(self, workers: int):
        self._count = workers

    def run(self, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job, Result]:
        """See :class:`sarsim.jobs.engine.Engine`."""
        todo, workers = deque((job, 1) for job in jobs), [Worker(lock) for _ in range(self._count)]
        idle, running = [*workers], dict[Future[Result], tuple[Worker, Job, int]]()
        try:
            while todo or running:
                while todo and idle:
                    worker, (job, attempt) = idle.pop(), todo.popleft()
                    running[worker.begin(work, job, lock.folder)] = worker, job, attempt
                for outcome in wait(running, return_when=FIRST_COMPLETED).done:
                    worker, job, attempt = running.pop(outcome)
                    idle.append(worker)
                    if not isinstance(outcome.exception(), BrokenProcessPool):
                        yield job, outcome
                        continue
                    status = worker.end()
                    if attempt == ATTEMPTS:
                        yield job, failed(f"{attempt} workers died over it, the last one with exit code {status}")
                    else:
                        _log.warning("job %s: its worker died; it begins again", job)
                        todo.appendleft((job, attempt + 1))
        finally:
            for worker in workers:
                worker.stop()
            for worker in workers:
                worker.end()


class Worker:
    """Does one job after the other in a process, a pool of its own: its death disturbs no other worker's job."""

    def __init__(self, lock: FolderLock):
        """The process, which starts with the first job, holds the ``lock`` as long as it lives."""
        self._lock = lock
        self._pool: ProcessPoolExecutor | None = None

    def begin(self, work: Work[Job, Result], job: Job, folder: Path) -> Future[Result]:
        """Let it do a job, in a new process if the last one is dead."""
        with starting():
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, WorkerContext(), initializer=_hold, initargs=(self._lock,))
            try:
                return self._pool.submit(tidily, done, work, job, folder)
            except BrokenProcessPool:  # it has died idle
                self.end()
        return self.begin(work, job, folder)

    def stop(self) -> None:
        """Let the process clean up and end."""
        for process in self._processes():
            process.terminate()

    def end(self) -> int | None:
        """End the process; its exit code, negative for a signal."""
        self.stop()
        processes, pool, self._pool = self._processes(), self._pool, None
        for process in processes:
            if not connection.wait([process.sentinel], CLEANING):
                process.kill()
        if pool is not None:
            pool.shutdown()
        return processes[0].exitcode if processes else None

    def _processes(self) -> list[BaseProcess]:
        """The process, if it was started."""
        return [] if self._pool is None else list(self._pool._processes.values())


def _hold(lock: FolderLock) -> None:
    """Do nothing: a process that has received a lock holds it."""
