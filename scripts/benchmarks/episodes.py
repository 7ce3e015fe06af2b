"""Whole episodes for the benchmark: each runs in a worker of one thread, and writes one JSON file and one picture.

Results stay in a folder, so that a long run can be interrupted and continued.
"""

import gc
import json
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, redirect_stderr
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import count, islice
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.files import whole_file
from pipeline.navigation.commands import Outcome
from pipeline.robot import Motion
from pipeline.sink import Sink
from sarsim.commands.cli import progress
from sarsim.episode import Episode
from sarsim.jobs.engines import make_engine
from sarsim.jobs.folder_lock import locked
from sarsim.methods.perception import make_classifier
from sarsim.scoring.progress import MOST
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from scripts.benchmarks.settings import DrivesSettings
from scripts.benchmarks.top_view import top_view

GROUPS = ("nist_6x4", "esogu_52x15", "raf", "random")  # Groups of arenas whose episodes are summarised together
STEPS = 1000  # At most; an episode ends earlier when no viewpoint is left

Strategy = Literal["ours", "nearest_frontier", "random_walk"]
Results = Sequence[dict[str, Any] | None]  # of jobs, None where a process failed


@dataclass(frozen=True)
class Job:
    """An episode to run.

    Attributes:
        group: of arenas, one of ``GROUPS``.
        strategy: that chooses the viewpoints.
        config: of the episode; its folder is not used.
    """

    group: str
    strategy: Strategy
    config: EpisodeConfig

    @property
    def name(self) -> str:
        """Name of its files, without suffix."""
        arena = world_name(self.config.arena).replace(":", "_")
        return f"{self.strategy}-{arena}-{self.config.seed}"

    @property
    def settings(self) -> dict[str, Any]:
        """Everything on which its result depends, as JSON values."""
        settings = {"group": self.group, "strategy": self.strategy, "config": asdict(self.config)}
        return json.loads(json.dumps(settings | {"version": version("sarsim")}, default=str))

    def result(self, folder: Path) -> dict[str, Any] | None:
        """The result of an earlier run, None if there is none; InputError if it has other settings or is broken."""
        file = folder / f"{self.name}.json"
        if not file.exists():
            return None
        try:
            content = json.loads(file.read_text())
            if content["settings"] == self.settings:
                return content
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: not an episode's result: {error}") from error
        raise InputError(f"{file}: holds a result with other settings; choose another folder with --runs")


def world_name(arena: str) -> str:
    """What an arena is called: by its file, or a model of Gazebo by its folder, for its file is ``model.sdf``."""
    path = Path(arena)
    return path.parent.name if path.name == "model.sdf" else path.stem


def configs(
    base: EpisodeConfig, drives: DrivesSettings, raf: Path | None = None
) -> Iterator[tuple[str, EpisodeConfig]]:
    """Group and settings of each episode, the longest first.

    ``base`` has the common settings, ``drives`` the numbers of episodes, ``raf`` is a folder of files.

    Raises:
        InputError: the weights cannot be used, or the folder holds no file.
    """
    make_classifier(base.labels, base.weights)
    rafs = sorted(raf.glob("*.raf")) if raf else []
    if raf and not rafs:
        raise InputError(f"--raf {raf}: contains no .raf file")
    # A random arena's difficulty is its seed modulo 4.
    seeds = islice((seed for seed in count() if seed % 4 != 3), drives.random)
    arenas = [("esogu_52x15", "esogu_52x15", seed) for seed in range(drives.esogu)]
    arenas += [("raf", str(file), 0) for file in rafs]
    arenas += [("random", f"random:{seed}", seed) for seed in seeds]
    arenas += [("nist_6x4", "nist_6x4", seed) for seed in range(drives.nist)]
    for group, arena, seed in arenas:
        yield group, replace(base, arena=arena, seed=seed, steps=STEPS)


def run_jobs(
    jobs: Sequence[Job], folder: Path, workers: int | None, run: Callable[..., None] | None = None, *args: Any
) -> list[dict[str, Any] | None]:
    """The result of every job, in their order; None for one whose process failed.

    ``run``, by default :func:`run_job`, is called with the job, the folder and ``args``, in up to ``workers``
    processes at a time, None for one per core. Ctrl-C ends it and the running jobs; results of finished jobs stay in
    the folder, and these jobs are not run again.

    Raises:
        InputError: the folder cannot be made, is in use, or holds results of other settings.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--runs {folder}: {error.strerror or error}") from error
    with locked(folder) as lock, progress() as bars:
        waiting = [job for job in jobs if job.result(folder) is None]
        bar = bars.add_task("episodes", total=len(waiting))
        work = partial(_run_with, run or run_job, args)
        with closing(make_engine(workers=workers).run(work, waiting, lock)) as outcomes:
            for _ in outcomes:
                bars.advance(bar)
    return [job.result(folder) for job in jobs]


def _run_with(run: Callable[..., None], args: tuple[Any, ...], job: Job, folder: Path) -> None:
    """Run a job; afterwards free its maps, which are in circles of references, for a worker runs many jobs."""
    run(job, folder, *args)
    gc.collect()


class Contacts(Sink):
    """Records where a robot was when it collided.

    Attributes:
        places: (2,) m, the robot's position at each collision.
    """

    def __init__(self, robot: SimulatedRobot):
        self._robot, self._collisions = robot, robot.collisions.collisions
        self.places: list[NDArray[np.float64]] = []

    def on_motion(self, motion: Motion) -> None:
        """Record the place if the robot has just collided."""
        if self._robot.collisions.collisions > self._collisions:
            self._collisions = self._robot.collisions.collisions
            self.places.append(self._robot.trajectory[-1].T_world_base[:2, 3])


class BenchmarkEpisode(Episode):
    """An episode with one of the strategies, which records where the robot was when it collided."""

    def __init__(self, job: Job, out: Path):
        exploration = "next_best_view" if job.strategy == "ours" else job.strategy
        super().__init__(replace(job.config, out=out, exploration=exploration))
        self._is_random = job.strategy == "random_walk"
        self._contacts = Contacts(self.robot)
        self.explorer.watch(self._contacts)

    def step(self) -> bool:
        """Like the step of every episode, except that a random walk ends when 90 % of the arena was seen."""
        return super().step() and not (self._is_random and self.score.coverage.fraction >= MOST["t90_s"])

    def picture(self) -> Rgb:
        """The run from above."""
        track = np.array([pose.T_world_base[:2, 3] for pose in self.robot.trajectory])
        failed = [leg.target for leg in self.explorer.pilot.navigator.legs if leg.outcome is not Outcome.REACHED]
        end = self.score.progress.time_s[-1]
        text = (
            f"{Path(self.config.arena).name}, seed {self.config.seed}:"
            f" {self.score.coverage.fraction:.1%} seen in {end:.0f} s,"
            f" {self.explorer.steps} steps, {len(self._contacts.places)} contacts, {len(failed)} legs not reached"
        )
        return top_view(self.score.surface, self.score.coverage.seen, track, self._contacts.places, failed, text)


def leave(job: Job, folder: Path, make: Callable[[], dict[str, Any] | None]) -> None:
    """Write the result of ``make`` to a folder, unless it is None or fails; stderr goes to a log beside it."""
    with (folder / f"{job.name}.log").open("w") as log, redirect_stderr(log):
        try:
            if (made := make()) is not None:
                content = {"settings": job.settings} | made
                with whole_file(folder / f"{job.name}.json") as file:
                    file.write_text(json.dumps(content, indent=1, default=float, allow_nan=False) + "\n")
        except Exception:
            traceback.print_exc()


def run_job(job: Job, folder: Path) -> None:
    """Run an episode and write its JSON file and its picture to a folder."""
    leave(job, folder, lambda: _run(job, folder))


def _run(job: Job, folder: Path) -> dict[str, Any] | None:
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        try:
            episode = BenchmarkEpisode(job, Path(out))
        except InputError as error:
            return {"left_out": str(error)}
        if not episode.run(show_progress=False):
            return None
        cv2.imwrite(str(folder / f"{job.name}.png"), cv2.cvtColor(episode.picture(), cv2.COLOR_RGB2BGR))
        score = episode.score
        return {"report": episode.report, "position_errors": score.position_errors, "find_errors": score.find_errors}
