"""Run an episode: the robot explores an arena, builds its maps and leaves a recording and a report."""

import os
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path

from rich.console import Console

from sarsim.scripts.cli import announce_compilation, end_by, run_watched
from sarsim.scripts.settings import run_with_settings, save_settings
from sarsim.scripts.tables import report_table
from sarsim.settings import EpisodeConfig


def run_episode(config: EpisodeConfig) -> None:
    """Explore an arena, and leave a recording, a report, the maps and config.yaml, with which --config repeats it."""
    from sarsim.episode import Episode

    announce_compilation()
    episode = Episode(config)
    save_settings(config, episode.out / "config.yaml")
    ended_by = run_watched(
        lambda interrupted, on_step: episode.run(interrupted, lambda line: on_step(episode.explorer.steps, line)),
        config.arena,
        config.steps,
    )
    console = Console()
    if episode.explorer.steps or episode.lost:
        console.print(report_table(episode.report))
    viewer = os.path.relpath(Path(sys.executable).with_name("sarsim-view"))
    console.print(f"Results in {episode.out}; to look at the recording: {viewer} {episode.out}", soft_wrap=True)
    if episode.explorer.steps:
        console.print(f"The page for rescuers: {episode.out / 'report.html'}", soft_wrap=True)
    end_by(ended_by)
    if episode.recorder.viewer and episode.recorder.viewer.page:
        console.print("Ctrl-C ends the page")
        episode.recorder.viewer.wait()


def elsewhere(config: EpisodeConfig) -> EpisodeConfig:
    """The same in a new folder, unless one is named: repeating an episode overwrites none."""
    folders = (Path(f"{config.folder}-{number}") for number in count(2))
    return config if config.out else replace(config, out=next(path for path in folders if not path.exists()))


def main() -> None:
    """Entry point."""
    run_with_settings(run_episode, EpisodeConfig, repeated=elsewhere)


if __name__ == "__main__":
    main()
