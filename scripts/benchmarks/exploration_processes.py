"""Episodes on all cores: a process each, of one thread; what has been finished before is not run again."""

import os
from collections.abc import Sequence
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from sarsim.dataset import processes
from sarsim.scripts.benchmarks.exploration_episode import Job, run_job


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0))


def run_jobs(jobs: Sequence[Job], folder: Path, workers: int) -> list[dict[str, Any] | None]:
    """The result of every job, in their order; None for one whose process failed.

    Ctrl-C ends it and the episodes under way; those that are finished stay in the folder.

    Raises:
        InputError: the folder holds results of other settings.
    """
    waiting = [job for job in jobs if job.result(folder) is None]
    columns = (
        "{task.description}",
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        bar = progress.add_task("episodes", total=len(waiting))
        running: list[BaseProcess] = []
        while waiting or running:
            while waiting and len(running) < workers:
                running.append(processes.start(run_job, waiting.pop(0), folder))
            connection.wait([process.sentinel for process in running])
            running = [process for process in running if process.is_alive()]
            progress.update(bar, completed=len(jobs) - len(waiting) - len(running))
    return [job.result(folder) for job in jobs]
