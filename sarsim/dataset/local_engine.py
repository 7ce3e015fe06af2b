"""An engine with workers on this machine, each a process with its own OpenGL context."""

import traceback
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path

from pipeline.errors import InputError
from sarsim.dataset import processes
from sarsim.dataset.engine import ATTEMPTS, Event, JobDone, JobFailed, JobLost, Make, PartDone
from sarsim.dataset.folder_lock import FolderLock


class LocalEngine:
    """Does jobs in worker processes; a worker that dies is replaced."""

    def __init__(self, workers: int):
        self._count = workers

    def run(self, make: Make, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """See :class:`sarsim.dataset.engine.Engine`."""
        todo, deaths = deque(indices), Counter[int]()
        workers: list[Worker] = []
        try:
            while todo or workers:
                while todo and len(workers) < self._count:
                    workers.append(Worker(make, folder, lock))
                    workers[-1].begin(todo.popleft())
                for worker in wait_for(workers):
                    event = worker.event()
                    if isinstance(event, JobLost):
                        deaths[event.index] += 1
                        if (died := deaths[event.index]) < ATTEMPTS:
                            todo.appendleft(event.index)
                        else:
                            last = f"the last one with exit code {worker.end()}"
                            event = JobFailed(event.index, InputError(f"{died} workers died over it, {last}"))
                    if isinstance(event, JobDone | JobFailed) and todo and worker.process.is_alive():
                        worker.begin(todo.popleft())
                    elif not isinstance(event, PartDone):
                        worker.end()
                        workers.remove(worker)
                    yield event
        finally:
            for worker in workers:
                worker.end()


class Worker:
    """A process that does one job after the other.

    Attributes:
        index: of the current job.
        process: of the worker.
    """

    def __init__(self, make: Make, folder: Path, lock: FolderLock):
        self.index = -1
        self.process, self.connection = processes.connected(_serve, lock, make, folder)

    def begin(self, index: int) -> None:
        """Let it do a job."""
        self.index = index
        with suppress(OSError):  # if it is dead, the next event is JobLost
            self.connection.send(index)

    def event(self) -> Event:
        """The worker's next event."""
        try:
            event: Event = self.connection.recv()
        except (EOFError, OSError):
            return JobLost(self.index)
        return event

    def end(self) -> int | None:
        """Stop the process; return its exit code, negative for a signal."""
        self.process.join(0.1)
        self.process.kill()
        self.process.join()
        self.connection.close()
        return self.process.exitcode


def wait_for(workers: Sequence[Worker]) -> list[Worker]:
    """Wait for events, and return the workers that have one, at least one worker."""
    ready = wait([worker.connection for worker in workers])
    return [worker for worker in workers if worker.connection in ready]


def _serve(connection: Connection, lock: FolderLock, make: Make, folder: Path) -> None:
    """The loop of a worker process, which holds the ``lock`` as long as it lives."""
    while True:
        index = connection.recv()
        try:
            product = make(index, folder, lambda: connection.send(PartDone(index)))  # noqa: B023
            connection.send(JobDone(product))
        except InputError as error:
            connection.send(JobFailed(index, error))
        except Exception:
            connection.send(JobFailed(index, RuntimeError(traceback.format_exc())))
