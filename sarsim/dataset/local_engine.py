"""An engine with workers on this machine, each a process with its own OpenGL context."""

import traceback
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path

from pipeline.errors import InputError
from sarsim.dataset import processes
from sarsim.dataset.engine import ATTEMPTS, Event, FrameDone, SceneDone, SceneLost
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene


class LocalEngine:
    """Makes scenes in worker processes; a worker that dies is replaced."""

    def __init__(self, workers: int):
        self._count = workers

    def render(self, recipe: Recipe, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """See :class:`sarsim.dataset.engine.Engine`."""
        todo, deaths = deque(indices), Counter[int]()
        workers: list[Worker] = []
        try:
            while todo or workers:
                while todo and len(workers) < self._count:
                    workers.append(Worker(recipe, folder, lock))
                    workers[-1].begin(todo.popleft())
                for worker in wait_for(workers):
                    event = worker.event()
                    if isinstance(event, SceneLost):
                        deaths[event.index] += 1
                        if (died := deaths[event.index]) >= ATTEMPTS:
                            last = f"the last one with exit code {worker.end()}"
                            raise InputError(f"scene {event.index}: {died} workers died over it, {last}")
                        todo.appendleft(event.index)
                    if isinstance(event, SceneDone) and todo:
                        worker.begin(todo.popleft())
                    elif not isinstance(event, FrameDone):
                        worker.end()
                        workers.remove(worker)
                    yield event
        finally:
            for worker in workers:
                worker.end()


class Worker:
    """A process that makes one scene after the other.

    Attributes:
        index: of the current scene.
        process: of the worker.
    """

    def __init__(self, recipe: Recipe, folder: Path, lock: FolderLock):
        self.index = -1
        self.process, self.connection = processes.connected(_serve, lock, recipe, folder)

    def begin(self, index: int) -> None:
        """Let it make a scene."""
        self.index = index
        with suppress(OSError):  # if it is dead, the next event is SceneLost
            self.connection.send(index)

    def event(self) -> Event:
        """The worker's next event; InputError if the scene cannot be made or written."""
        try:
            message = self.connection.recv()
        except (EOFError, OSError):
            return SceneLost(self.index)
        if isinstance(message, Exception):
            raise message
        return message

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


def _serve(connection: Connection, lock: FolderLock, recipe: Recipe, folder: Path) -> None:
    """The loop of a worker process, which holds the ``lock`` as long as it lives."""
    while True:
        index = connection.recv()
        try:
            entry = make_scene(recipe, index, folder, lambda: connection.send(FrameDone(index)))  # noqa: B023
            connection.send(SceneDone(entry))
        except InputError as error:
            connection.send(error)
        except Exception:
            connection.send(RuntimeError(f"scene {index}: {traceback.format_exc()}"))
