"""Episodes of a benchmark: each runs in a single-threaded worker and leaves a JSON file in the folder ``--runs``.

The results stay in this folder, so that a long benchmark can be interrupted and resumed.
"""

import gc
import json
import re
import shutil
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, redirect_stderr
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from pipeline.errors import InputError
from pipeline.files import atomic_write
from sarsim.commands.cli import progress
from sarsim.episode import Episode
from sarsim.jobs import locked, make_engine
from sarsim.methods.perception import make_classifier
from sarsim.plugins.finds.score import FindScore
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import check_at_least
from scripts.benchmarks.settings import DrivesSettings, RunsSettings

GROUPS = ("nist_6x4", "esogu_52x15", "raf", "random")
"""Groups of arenas whose episodes are summarised together; any other arena is a group of its own."""
MAX_STEPS = 1000  # Maximum number of steps; an episode ends earlier if no viewpoint is left

Results = Sequence[dict[str, Any] | None]  # One per job; None where the job failed
AnyJob = TypeVar("AnyJob", bound="Job")


@dataclass(frozen=True)
class Job:
    """An episode to run.

    Attributes:
        group: group of figures to which the episode belongs.
        config: settings of the episode; ``out`` is ignored.
    """

    group: str
    config: EpisodeConfig

    @property
    def name(self) -> str:
        """Name of the job's files, without suffix."""
        return re.sub(r"[^\w.-]+", "_", f"{self.group}-{arena_name(self.config.arena)}-{self.config.seed}")

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that the job's result depends on, as JSON values."""
        settings = {"group": self.group, "config": asdict(self.config), "version": version("sarsim")}
        return json.loads(json.dumps(settings, default=str))

    def result(self, folder: Path) -> dict[str, Any] | None:
        """The result of an earlier run, or None; InputError if the run's settings differ or the file is broken."""
        file = folder / f"{self.name}.json"
        if not file.exists():
            return None
        try:
            content = json.loads(file.read_text())
            if content["settings"] == self.settings:
                return content
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"{file}: not a valid episode result ({error!r}); delete it to run the episode again"
            ) from error
        raise InputError(f"{file}: contains a result with other settings; choose another folder with --runs")


def arena_name(arena: str) -> str:
    """The stem of an arena's file name; for a Gazebo model, whose file is always ``model.sdf``, its folder's name."""
    path = Path(arena)
    return path.parent.name if path.name == "model.sdf" else path.stem


def jobs_of(base: EpisodeConfig, drives: DrivesSettings) -> Iterator[Job]:
    """The episodes in every arena with every seed.

    ``base`` has the settings that all episodes share.

    Raises:
        InputError: there is no arena, a folder contains no .raf file, or the weights cannot be used.
    """
    if not (drives.arenas and drives.seeds):
        raise InputError("--arenas and --seeds: give at least one of each")
    make_classifier(base.labels, base.weights)
    for given in drives.arenas:
        files = sorted(Path(given).glob("*.raf")) if Path(given).is_dir() else [Path(given)]
        if not files:
            raise InputError(f"--arenas {given}: the folder contains no .raf files")
        for file in files:
            is_raf = file.suffix == ".raf"
            group = "raf" if is_raf else "random" if given.startswith("random:") else arena_name(given)
            arena = str(file) if is_raf else given
            yield from (Job(group, replace(base, arena=arena, seed=s, steps=MAX_STEPS)) for s in drives.seeds)


def run_jobs(
    jobs: Sequence[AnyJob], settings: RunsSettings, run: Callable[[AnyJob], dict[str, Any] | None]
) -> list[dict[str, Any] | None]:
    """The result of every job, in the order of ``jobs``; None for a job that failed.

    ``run`` is called in worker processes and returns the result of a job. Ctrl-C stops the running jobs. Results of
    finished jobs stay in the folder, and these jobs are not run again.

    Raises:
        InputError: the folder cannot be created, is in use, or holds results with other settings.
    """
    check_at_least(1, settings, "workers")
    folder = settings.runs
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--runs {folder}: cannot be created: {error.strerror or error}") from error
    with locked(folder) as lock, progress() as bars:
        waiting = [job for job in jobs if job.result(folder) is None]
        bar = bars.add_task("episodes", total=len(waiting))
        with closing(make_engine(workers=settings.workers)(partial(write_result, run), waiting, lock)) as outcomes:
            for job, _, failure in outcomes:
                if failure is not None:  # Of a worker that died, because a job's own error is in its log
                    with (folder / f"{job.name}.log").open("a") as log:
                        log.write(f"{failure}\n")
                bars.advance(bar)
    return [job.result(folder) for job in jobs]


def run_jobs_or_raise(
    jobs: Sequence[AnyJob], settings: RunsSettings, run: Callable[[AnyJob], dict[str, Any]]
) -> list[dict[str, Any]]:
    """The results of jobs, see :func:`run_jobs`; InputError if a job failed."""
    results = run_jobs(jobs, settings, run)
    if failed := failures(jobs, results):
        raise InputError(f"{', '.join(failed)} failed; see the .log files in {settings.runs}")
    return [result for result in results if result]


def failures(jobs: Sequence[Job], results: Results) -> list[str]:
    """The names of the jobs that failed."""
    return [job.name for job, result in zip(jobs, results, strict=True) if result is None]


def write_result(run: Callable[[AnyJob], dict[str, Any] | None], job: AnyJob, folder: Path) -> None:
    """Write a job's result to its JSON file, unless the result is None or the job fails; stderr goes to a log."""
    with (folder / f"{job.name}.log").open("w") as log, redirect_stderr(log):
        try:
            result = run(job)
            if result is not None:
                with atomic_write(folder / f"{job.name}.json") as file:
                    file.write_text(
                        json.dumps({"settings": job.settings} | result, indent=1, default=float, allow_nan=False)
                    )
        except Exception:
            traceback.print_exc()
    gc.collect()  # An episode's maps are in reference cycles, and a worker runs many jobs


def run_episode(job: Job, pages: Path | None = None) -> dict[str, Any] | None:
    """Run an episode; the result is its report, and the position errors of people and finds.

    The episode's rescue report, which shows its map, is left in the folder ``pages`` as ``<name of the job>.html``.
    """
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        try:
            episode = Episode(replace(job.config, out=Path(out)))
        except InputError as error:
            return {"left_out": str(error)}
        if not episode.run(show_progress=False):
            return None
        if pages is not None:
            shutil.copyfile(Path(out, "report.html"), pages / f"{job.name}.html")
    score = episode.score
    found = [sink.errors for sink in episode.parts.sinks if isinstance(sink, FindScore)]
    return {
        "report": episode.report,
        "position_errors": score.position_errors,
        "find_errors": found[0] if found else {},
    }
