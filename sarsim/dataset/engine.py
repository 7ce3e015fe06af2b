"""The interface of engines, which do many jobs, such as scenes of a dataset, independently of each other."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sarsim.dataset.folder_lock import FolderLock

ATTEMPTS = 3  # Largest number of attempts at a job whose workers die


class Product(Protocol):
    """What a job leaves: a file.

    Attributes:
        index: of the job.
        file: its path in the folder of the results.
    """

    @property
    def index(self) -> int: ...  # noqa: D102 - see the class

    @property
    def file(self) -> str: ...  # noqa: D102 - see the class


Make = Callable[[int, Path, Callable[[], object]], Product]
"""Does the job of an index: writes its file into a folder, and calls the function after every part of the job.

It is sent to other processes, and raises InputError if the job cannot be done.
"""


@dataclass(frozen=True)
class PartDone:
    """A part of the job ``index`` is done."""

    index: int


@dataclass(frozen=True)
class JobDone:
    """A job's file is complete."""

    product: Product


@dataclass(frozen=True)
class JobLost:
    """A worker died over the job ``index``, which begins again."""

    index: int


@dataclass(frozen=True)
class JobFailed:
    """The job ``index`` cannot be done."""

    index: int
    error: Exception


Event = PartDone | JobDone | JobLost | JobFailed


class Engine(Protocol):
    """Does jobs."""

    def run(self, make: Make, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """Do jobs, in any order, and put their files into a folder; closing the iterator stops this.

        Every process that writes there must hold the ``lock``.
        """
        ...
