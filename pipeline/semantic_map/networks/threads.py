"""Threads that share the rows of a block, or blocks."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Barrier
from typing import TypeVar

import torch

Item = TypeVar("Item")
Result = TypeVar("Result")


class Threads:
    """A few threads, each of which computes alone: PyTorch starts no threads of its own inside them.

    PyTorch's own threads split every small operation and then wait for the slowest one, long on a busy machine.
    """

    def __init__(self, count: int) -> None:
        """Start ``count`` threads."""
        self._count = count
        # PyTorch's setting holds for the thread that sets it and for threads that start later.
        with torch_threads(1):
            self._pool = ThreadPoolExecutor(count)
            all_started = Barrier(count)
            list(self._pool.map(lambda _: (torch.get_num_threads(), all_started.wait()), range(count)))

    def run(self, action: Callable[[], Result]) -> Result:
        """Call ``action`` in one of the threads, without automatic differentiation."""
        return self._pool.submit(torch.inference_mode()(action)).result()

    def each(self, items: Iterable[Item], action: Callable[[Item], Result]) -> Iterator[Result]:
        """``action`` of every item, each in the next free thread, without automatic differentiation."""
        return self._pool.map(torch.inference_mode()(action), items)

    def over(self, tiles: Sequence[slice], action: Callable[[slice], object]) -> None:
        """Call ``action`` for every slice of rows, each in the next free thread; to be called inside ``run``."""
        left = iter(tiles)

        @torch.inference_mode()
        def work() -> None:
            for rows in left:
                action(rows)

        others = [self._pool.submit(work) for _ in range(self._count - 1)]
        try:
            work()
        finally:
            # Tasks that have not begun have no rows left, and waiting for them could take for ever: cancel them.
            running = [other for other in others if not other.cancel()]
        for other in running:
            other.result()


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let PyTorch compute in ``count`` threads inside the context; with 1 it starts no threads of its own."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
