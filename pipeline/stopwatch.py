"""Measures the wall time of each stage of the pipeline."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Stopwatch:
    """Collects the wall time of named stages.

    Attributes:
        seconds: for each stage, the duration of each of its runs, s.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block of a ``with`` statement."""
        begin = perf_counter()
        yield
        self.seconds[stage].append(perf_counter() - begin)
