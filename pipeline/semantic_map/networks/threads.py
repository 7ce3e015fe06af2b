"""Threads that compute the rows of a block, or several blocks, in parallel."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Barrier
from typing import TypeVar

import torch

Item = TypeVar("Item")
Result = TypeVar("Result")


class Threads:
    """A pool of threads, in which PyTorch starts no threads of its own.

    PyTorch's threads split every small operation and then wait for the slowest thread, which takes long on a busy
    machine.
    """

    def __init__(self, count: int) -> None:
        """Start ``count`` threads."""
        self._count = count
        # PyTorch's setting applies to the thread that sets it and to threads that start later.
        with torch_threads(1):
            self._pool = ThreadPoolExecutor(count)
            all_started = Barrier(count)
            list(self._pool.map(lambda _: (torch.get_num_threads(), all_started.wait()), range(count)))

    def run(self, action: Callable[[], Result]) -> Result:
        """Call ``action`` in one of the threads, without automatic differentiation."""
        return self._pool.submit(torch.inference_mode()(action)).result()

    def each(self, items: Iterable[Item], action: Callable[[Item], Result]) -> Iterator[Result]:
        """The result of ``action`` for each item, run in the next free thread, without automatic differentiation."""
        return self._pool.map(torch.inference_mode()(action), items)

    def over(self, tiles: Sequence[slice], action: Callable[[slice], object]) -> None:
        """Call ``action`` for every slice of rows, each in the next free thread; must be called inside ``run``."""
        left = iter(tiles)

        @torch.inference_mode()
        def work() -> None:
            for rows in left:
                action(rows)

        others = [self._pool.submit(work) for _ in range(self._count - 1)]
        try:
            work()
        finally:
            # Cancel tasks that have not started, because no rows are left, and waiting for them could take forever.
            running = [other for other in others if not other.cancel()]
        for other in running:
            other.result()


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let PyTorch compute in ``count`` threads inside the context; with 1, PyTorch starts no threads of its own."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
