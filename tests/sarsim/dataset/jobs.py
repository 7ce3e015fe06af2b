"""Jobs for tests of the engine itself: their workers import no simulator, and begin at once."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

LONG = 60.0  # s, of a job that is to be killed meanwhile


@dataclass(frozen=True)
class Made:
    """What a job leaves."""

    index: int
    file: str


def write(index: int, folder: Path, part_done: Callable[[], object]) -> Made:
    """Write a file."""
    part_done()
    path = folder / f"{index}.txt"
    path.write_text(f"{index}\n")
    return Made(index, path.name)


def hang_the_first_time(index: int, folder: Path, part_done: Callable[[], object]) -> Made:
    """Write a file, but not at the first attempt, which stays halfway."""
    begun = folder / "begun"
    if not begun.exists():
        begun.touch()
        part_done()
        time.sleep(LONG)
    return write(index, folder, part_done)


def hang_at_0(index: int, folder: Path, part_done: Callable[[], object]) -> Made:
    """Write a file, but job 0 always stays halfway."""
    if index == 0:
        part_done()
        time.sleep(LONG)
    return write(index, folder, part_done)
