"""Progress on stderr: a bar in a terminal, lines in a file or in a service's log."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.progress import Progress as Bars
from rich.text import Text

from pipeline.progress import Progress

LINE_INTERVAL = 10.0  # s between lines of progress if there is no terminal


class PlainBars(Bars):
    """Progress as lines on stderr, for a file or service log: one every ``LINE_INTERVAL`` s, and one at the end."""

    def start(self) -> None:
        """Draw nothing, and schedule the first line."""
        self._due = time.monotonic() + LINE_INTERVAL

    def stop(self) -> None:
        """Draw nothing."""

    def __exit__(self, error: type[BaseException] | None, *_: Any) -> None:
        """Print the final progress of every task, unless an error ended the block."""
        for task in self.tasks if error is None else []:
            self._print(task)

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """Update a task, and print its progress if a line is due."""
        super().update(task_id, **changes)
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + LINE_INTERVAL
            self._print(self._tasks[task_id])

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Add ``advance`` to the completed amount of a task, and print its progress if a line is due."""
        self.update(task_id, advance=advance)

    def _print(self, task: Task) -> None:
        if self.disable:
            return
        of = f" of {task.total:g}" if task.total else ""
        counted = f": {task.completed:g}{of}" if "is_timed" not in task.fields else ""
        left = f", {remaining_time_text(task)}" if remaining_time_text(task) else ""
        print(f"{task.description}{counted}, {task.elapsed or 0:.0f} s elapsed{left}", file=sys.stderr, flush=True)


class _RemainingTime(ProgressColumn):
    """The remaining time of a run, if it can be estimated."""

    def render(self, task: Task) -> Text:
        return Text(remaining_time_text(task), style="progress.remaining")


def remaining_time_text(task: Task) -> str:
    """The remaining time of a task as text; empty at its start, or if its field ``is_timed`` is not true."""
    if not task.fields.get("is_timed") or not task.elapsed or not task.completed or not task.total:
        return ""
    seconds = round(task.elapsed * (task.total - task.completed) / task.completed)
    return f"about {timedelta(seconds=seconds)} left"


def progress_bars(disable: bool = False, transient: bool = False) -> Bars:
    """Progress bars with counts and elapsed time; lines if stderr is not a terminal.

    ``transient``: whether the bars disappear at the end.
    """
    columns = *Bars.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn()
    return _bars(columns, disable, transient)


@contextmanager
def shown_run(description: str, disable: bool = False) -> Iterator[Callable[[Progress], None]]:
    """Show the progress of a run during a ``with`` block, and yield a function that receives this progress."""
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        _RemainingTime(),
    )
    with _bars(columns, disable) as bars:
        bar = bars.add_task(description, total=None, is_timed=False)

        def show(progress: Progress) -> None:
            has_fraction = progress.fraction is not None
            # Set directly, because Rich's update ignores a new total of None.
            bars.tasks[0].total = 1.0 if has_fraction else None
            bars.update(
                bar, description=progress.text, completed=progress.fraction or 0.0, is_timed=progress.is_timed
            )

        yield show


def _bars(columns: tuple[ProgressColumn, ...], disable: bool, transient: bool = False) -> Bars:
    console = Console(stderr=True)
    if not console.is_terminal:
        return PlainBars(auto_refresh=False, disable=disable)
    return Bars(*columns, console=console, transient=transient, disable=disable)
