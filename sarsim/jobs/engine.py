"""The interface of engines, which run many independent jobs, such as scenes of a dataset."""

import traceback
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Protocol, TypeVar

from pipeline.errors import InputError
from sarsim.jobs.folder_lock import FolderLock

ATTEMPTS = 3  # Maximum number of attempts at a job whose workers die

Job = TypeVar("Job")
Result = TypeVar("Result")
Work = Callable[[Job, Path], Result]
"""A function that does a job and writes files into a folder. It must be picklable.

It raises InputError if the job cannot be done.
"""
Outcomes = Generator[tuple[Job, Future[Result]]]
"""Yields each job with its outcome when it ends; closing the generator ends the workers."""


class Engine(Protocol):
    """Runs jobs."""

    def run(self, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job, Result]:
        """Run jobs in any order; their files go into the locked folder. Every process that writes holds the lock."""
        ...


def done(work: Work[Job, Result], job: Job, folder: Path) -> Result:
    """Do a job in a worker. Exceptions other than InputError become RuntimeErrors, which can always be pickled."""
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
