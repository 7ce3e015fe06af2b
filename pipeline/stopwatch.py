"""How long the stages take."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Stopwatch:
    """Collects the wall time of named stages.

    Attributes:
        seconds: one entry for every time that a stage ran, by its name.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time the block under it."""
        begin = perf_counter()
        yield
        self.seconds[stage].append(perf_counter() - begin)
