"""Complete episodes for the benchmark: each runs in a single-threaded worker and writes a JSON file and a picture.

The results stay in a folder, so that a long run can be interrupted and resumed.
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
from pipeline.files import atomic_write
from pipeline.navigation.commands import Outcome
from pipeline.robot import Motion
from pipeline.sink import Sink
from sarsim.commands.cli import progress
from sarsim.episode import Episode
from sarsim.jobs import locked, make_engine
from sarsim.methods.perception import make_classifier
from sarsim.scoring.progress import MOST
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from scripts.benchmarks.settings import DrivesSettings
from scripts.benchmarks.top_view import top_view

GROUPS = ("nist_6x4", "esogu_52x15", "raf", "random")  # Groups of arenas whose episodes are summarised together
STEPS = 1000  # Maximum number; an episode ends earlier if no viewpoint is left

Strategy = Literal["ours", "nearest_frontier", "random_walk"]
Results = Sequence[dict[str, Any] | None]  # One per job; None where the process failed


@dataclass(frozen=True)
class Job:
    """An episode to run.

    Attributes:
        group: the group of arenas, usually one of ``GROUPS``.
        strategy: the exploration strategy.
        config: settings of the episode; ``out`` is ignored.
    """

    group: str
    strategy: Strategy
    config: EpisodeConfig

    @property
    def name(self) -> str:
        """Name of the job's files, without suffix."""
        arena = world_name(self.config.arena).replace(":", "_")
        return f"{self.strategy}-{arena}-{self.config.seed}"

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that the job's result depends on, as JSON values."""
        settings = {"group": self.group, "strategy": self.strategy, "config": asdict(self.config)}
        return json.loads(json.dumps(settings | {"version": version("sarsim")}, default=str))

    def result(self, folder: Path) -> dict[str, Any] | None:
        """The result of an earlier run, or None; InputError if its settings differ or the file is broken."""
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


def world_name(arena: str) -> str:
    """The stem of an arena's file name; for a Gazebo model, whose file is always ``model.sdf``, its folder's name."""
    path = Path(arena)
    return path.parent.name if path.name == "model.sdf" else path.stem


def configs(
    base: EpisodeConfig, drives: DrivesSettings, raf: Path | None = None
) -> Iterator[tuple[str, EpisodeConfig]]:
    """Group and settings of each episode, the longest episodes first.

    ``base`` has the common settings, ``drives`` the numbers of episodes; ``raf`` is a folder of .raf arenas.

    Raises:
        InputError: the weights cannot be used, or the folder contains no .raf file.
    """
    make_classifier(base.labels, base.weights)
    rafs = sorted(raf.glob("*.raf")) if raf else []
    if raf and not rafs:
        raise InputError(f"--raf {raf}: contains no .raf files")
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
    """The result of every job, in the order of ``jobs``; None for a job whose process failed.

    ``run``, by default :func:`run_job`, is called with the job, the folder and ``args``, in up to ``workers``
    processes at a time (None: one per core). Ctrl-C stops the running jobs. Results of finished jobs stay in the
    folder, and these jobs are not run again.

    Raises:
        InputError: the folder cannot be created, is in use, or holds results with other settings.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--runs {folder}: cannot be created: {error.strerror or error}") from error
    with locked(folder) as lock, progress() as bars:
        waiting = [job for job in jobs if job.result(folder) is None]
        bar = bars.add_task("episodes", total=len(waiting))
        work = partial(_run_with, run or run_job, args)
        with closing(make_engine(workers=workers)(work, waiting, lock)) as outcomes:
            for _ in outcomes:
                bars.advance(bar)
    return [job.result(folder) for job in jobs]


def _run_with(run: Callable[..., None], args: tuple[Any, ...], job: Job, folder: Path) -> None:
    """Run a job, then free its maps, which are in reference cycles: a worker runs many jobs."""
    run(job, folder, *args)
    gc.collect()


class Contacts(Sink):
    """Records the robot's positions at collisions.

    Attributes:
        places: the robot's position at each collision, each (2,), m.
    """

    def __init__(self, robot: SimulatedRobot):
        self._robot, self._collisions = robot, robot.collisions.collisions
        self.places: list[NDArray[np.float64]] = []

    def on_motion(self, motion: Motion) -> None:
        """Record the robot's position if it has just collided."""
        if self._robot.collisions.collisions > self._collisions:
            self._collisions = self._robot.collisions.collisions
            self.places.append(self._robot.trajectory[-1].T_world_base[:2, 3])


class BenchmarkEpisode(Episode):
    """An episode that explores with a job's strategy and records where the robot collided."""

    def __init__(self, job: Job, out: Path):
        exploration = "next_best_view" if job.strategy == "ours" else job.strategy
        super().__init__(replace(job.config, out=out, exploration=exploration))
        self._is_random = job.strategy == "random_walk"
        self._contacts = Contacts(self.robot)
        self.explorer.watch(self._contacts)

    def step(self) -> bool:
        """Do one step, as in any episode; a random walk also ends once 90 % of the arena has been seen."""
        return super().step() and not (self._is_random and self.score.coverage.fraction >= MOST["t90_s"])

    def picture(self) -> Rgb:
        """Top view of the run."""
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
    """Write what ``make`` returns to a job's JSON file, unless it is None or ``make`` fails; stderr goes to a log."""
    with (folder / f"{job.name}.log").open("w") as log, redirect_stderr(log):
        try:
            if (made := make()) is not None:
                content = {"settings": job.settings} | made
                with atomic_write(folder / f"{job.name}.json") as file:
                    file.write_text(json.dumps(content, indent=1, default=float, allow_nan=False) + "\n")
        except Exception:
            traceback.print_exc()


def run_job(job: Job, folder: Path) -> None:
    """Run an episode and write its JSON file and picture to a folder."""
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
