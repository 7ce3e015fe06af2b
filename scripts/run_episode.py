"""Run an episode: the robot explores an arena, builds its maps and leaves a recording and a report."""

import os
import sys
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

from sarsim.episode import Episode, EpisodeConfig
from sarsim.scripts.cli import INTERRUPTED, Interruptible, run
from sarsim.scripts.tables import report_table


def run_episode(config: Annotated[EpisodeConfig, tyro.conf.arg(name="")]) -> None:
    """Run the episode, print its report and say where it lies."""
    episode = Episode(config)
    finished = run_with_progress(episode)
    console = Console()
    if episode.explorer.steps:
        console.print(report_table(episode.report))
    viewer = os.path.relpath(Path(sys.executable).with_name("sarsim-view"))
    console.print(
        f"Results in {episode.out}; to look at the recording: {viewer} {episode.out}", soft_wrap=True
    )
    if finished and episode.recorder.viewer and episode.recorder.viewer.page:
        console.print("Ctrl-C ends the page")
        episode.recorder.viewer.wait()
    if not finished:
        raise SystemExit(INTERRUPTED)


def run_with_progress(episode: Episode) -> bool:
    """Run an episode with a progress bar; False if Ctrl-C ended it."""
    columns = (*Progress.get_default_columns(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress, Interruptible() as control:
        bar = progress.add_task(episode.config.arena, total=episode.config.steps)
        return episode.run(
            lambda: control.interrupted,
            lambda line: progress.update(bar, completed=episode.explorer.steps, description=line),
        )


def main() -> None:
    """Entry point."""
    run(run_episode)


if __name__ == "__main__":
    main()
