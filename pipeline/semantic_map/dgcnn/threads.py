"""Threads that share the rows of a block."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import torch


class RowThreads:
    """A few threads, each of which computes alone: matrix products inside them start no threads of their own."""

    def __init__(self, count: int) -> None:
        """Start ``count`` threads."""
        # PyTorch's setting holds for the thread that makes it, and for threads that are started later.
        default = torch.get_num_threads()
        self._pool = ThreadPoolExecutor(count, initializer=torch.set_num_threads, initargs=(1,))
        self._count = count
        all_started = Barrier(count)
        list(self._pool.map(lambda _: all_started.wait(), range(count)))
        torch.set_num_threads(default)

    def over(self, rows: int, tile: int, action: Callable[[slice], object]) -> None:
        """Call ``action`` for tiles of ``tile`` rows; whichever thread is free takes the next one."""
        starts = iter(range(0, rows, tile))

        def work(_: int) -> None:
            with torch.inference_mode():
                for start in starts:
                    action(slice(start, min(start + tile, rows)))

        list(self._pool.map(work, range(self._count)))
