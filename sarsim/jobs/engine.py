"""The interface of engines, which do many jobs, such as scenes of a dataset, independently of each other."""

import traceback
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Protocol, TypeVar

from pipeline.errors import InputError
from sarsim.jobs.folder_lock import FolderLock

ATTEMPTS = 3  # Largest number of attempts at a job whose workers die

Job = TypeVar("Job")
Result = TypeVar("Result")
Work = Callable[[Job, Path], Result]
"""Does a job, and writes files into a folder. It is sent to other processes.

It raises InputError if the job cannot be done.
"""
Outcomes = Generator[tuple[Job, Future[Result]]]
"""Each job with its outcome, as it ends; closing the generator ends the workers."""


class Engine(Protocol):
    """Does jobs."""

    def run(self, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job, Result]:
        """Do jobs, in any order; their files get into the locked folder, and who writes there holds the lock."""
        ...


def done(work: Work[Job, Result], job: Job, folder: Path) -> Result:
    """Do a job in a worker; what it raises besides InputError becomes a RuntimeError, which can always be sent."""
    try:
        return work(job, folder)
    except InputError:
        raise
    except Exception:
        raise RuntimeError(traceback.format_exc()) from None


def failed(reason: str) -> Future[Result]:
    """The outcome of a job that cannot be done."""
    future: Future[Result] = Future()
    future.set_exception(InputError(reason))
    return future
