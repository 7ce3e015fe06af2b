"""BARN's cylinder worlds, crossed using the whole pipeline, with the robot's own camera and localisation.

The rules follow the challenge's program (github.com/Daffan/the-barn-challenge, run.py); see Perille et al.,
"Benchmarking Metric Ground Navigation" (SSRR 2020), and Xiao et al., "Autonomous Ground Navigation in Highly
Constrained Spaces" (2022).
"""

import re
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places, Pose
from pipeline.errors import InputError
from pipeline.robot import Motion
from pipeline.run import TimeIsUpError
from pipeline.sink import Sink
from sarsim.commands.sweeps.statistics import estimate, plain_mean
from sarsim.episode import Episode
from sarsim.robots.model import robot_model
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.runs import Job, run_jobs_or_raise
from scripts.benchmarks.settings import BarnSettings

START = (-2.25, 3.0, 90.0)
"""The start pose: x and y in m, heading in degrees."""
GOAL = (-2.25, 13.0)
"""x and y of the goal, m, which is 10 m ahead of the start."""
ARRIVAL_DISTANCE = 1.0  # m, maximum distance from the goal at which the goal is reached
START_DISTANCE = 0.1  # m, distance from the start at which the clock starts
TIME_LIMIT = 100.0  # s, time limit of a run
SPEED = 2.0  # m/s, speed on the reference path: the Jackal's top speed according to its data sheet
MIN_TIME_RATIO, MAX_TIME_RATIO = (
    2.0,
    8.0,
)  # Multiples of the reference time between which the score of a success decreases
CELL = 0.15  # m, side of a cell of the reference path
FIRST_CELL = np.array([-4.575, 5.075])  # m, the centre of cell (0, 0)
PUBLISHED = {"the challenge's baseline: DWA with a 270° lidar": 0.169, "best possible": 0.5}
"""Published scores, for comparison."""

Run = Mapping[str, Any]
"""How a run ended, its time in s, path length in m, and number of contacts."""


def measure(settings: BarnSettings) -> Result:
    """Success, contacts, time and score in each world, and the mean score with its interval.

    Raises:
        InputError: the folder has no world, a world has no reference path, a run failed, or a setting is wrong.
    """
    check_at_least(1, settings, "seeds")
    worlds = worlds_in(settings.worlds)
    robot_model(settings.robot)
    # Cross each world with every seed.
    jobs = [job for name in worlds for job in jobs_in(settings, name)]
    runs = [result["run"] for result in run_jobs_or_raise(jobs, settings, run_job)]
    by_world = {name: runs[n * settings.seeds : (n + 1) * settings.seeds] for n, name in enumerate(worlds)}
    ended = Counter(run["ended"] for run in runs)
    notes = ["how runs ended: " + ", ".join(f"{count} {how}" for how, count in ended.items())]
    notes += [f"{who}: {value:g}" for who, value in PUBLISHED.items()]
    return Result(figures(by_world, worlds), {"runs": by_world, "published": PUBLISHED}, notes)


def worlds_in(folder: Path) -> dict[str, float]:
    """Names of the worlds in a folder, in numerical order, each with the optimal time of its reference path, s.

    Raises:
        InputError: there is no world, or a path is missing or broken.
    """
    numbers = sorted(
        int(m[1]) for file in folder.glob("world_*.world") if (m := re.fullmatch(r"world_(\d+)", file.stem))
    )
    if not numbers:
        raise InputError(f"--worlds {folder}: contains no file such as world_0.world")
    return {f"world_{n}": optimal_seconds(read_path(folder / f"path_{n}.npy")) for n in numbers}


def jobs_in(settings: BarnSettings, world: str) -> list[Job]:
    """The runs in a world, one per seed."""
    config = EpisodeConfig(
        arena=str(settings.worlds / f"{world}.world"),
        start=START,
        goals=(GOAL,),
        robot=settings.robot,
        speed=settings.speed,
        labels="rules",
        detector=None,
        pipeline=settings.pipeline,
    )
    return [Job("barn", replace(config, seed=seed)) for seed in range(settings.seeds)]


def run_job(job: Job) -> dict[str, Any]:
    """Cross a world, and return the result of the run."""
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        crossing = Crossing(replace(job.config, out=Path(out)))
        crossing.episode.run(show_progress=False)
    return {"run": crossing.result}


@dataclass
class BarnJudge:
    """Judges a run by the robot's true pose.

    Attributes:
        set_down_time: time at which the robot was set down, s.
        clock_start: time at which the robot had moved far enough for the clock to start, s; None before that time.
        ended: how the run ended, ``reached``, ``contact`` or ``time``; None before the end.
        seconds: time on the clock, s; 0 until the clock starts.
    """

    set_down_time: float
    clock_start: float | None = None
    ended: str | None = None
    seconds: float = 0.0

    def see(self, time: float, T_world_base: Pose, contacts: int) -> bool:
        """Judge a true pose at a time, s, and the number of contacts so far; return whether the run may continue.

        For a robot that has not moved, the time limit counts from the time at which the robot was set down.
        """
        place = T_world_base[:2, 3]
        if self.clock_start is None and np.linalg.norm(place - START[:2]) >= START_DISTANCE:
            self.clock_start = time
        self.seconds = 0.0 if self.clock_start is None else time - self.clock_start
        late = time - (self.set_down_time if self.clock_start is None else self.clock_start) >= TIME_LIMIT
        arrived = bool(np.linalg.norm(place - GOAL) <= ARRIVAL_DISTANCE)
        self.ended = "contact" if contacts else "time" if late else "reached" if arrived else None
        return self.ended is None


class Crossing(Sink):
    """An episode with BARN's goal, which the judge ends."""

    def __init__(self, config: EpisodeConfig):
        self.episode = Episode(config)
        self._robot: SimulatedRobot = self.episode.robot
        self.judge = BarnJudge(self._robot.time)
        self.episode.explorer.watch(self)

    def on_motion(self, motion: Motion) -> None:
        """Raise TimeIsUpError, which ends the episode, if the run is over."""
        pose = self._robot.trajectory[-1]
        if not self.judge.see(pose.time, pose.T_world_base, self._robot.collisions.collisions):
            raise TimeIsUpError

    @property
    def result(self) -> Run:
        """The result of the run; a run that the robot ended itself is ``lost`` or ``given_up``."""
        judge, episode = self.judge, self.episode
        ended = judge.ended or ("lost" if episode.lost_reason else "given_up")
        navigation = episode.report["navigation"]
        return {"ended": ended, "seconds": judge.seconds} | {
            key: navigation[key] for key in ("distance_m", "collisions", "mean_speed", "time_s") if key in navigation
        }


def score(seconds: float | None, optimal: float) -> float:
    """Score of a run, 1/8 to 1/2, or 0 without success (``seconds`` is None); ``optimal``: reference time, s."""
    return (
        0.0
        if seconds is None
        else optimal / float(np.clip(seconds, MIN_TIME_RATIO * optimal, MAX_TIME_RATIO * optimal))
    )


def optimal_seconds(cells: NDArray[np.float64]) -> float:
    """Time, s, to drive the reference path from the start via (K, 2) cells to the goal."""
    path = np.vstack([START[:2], FIRST_CELL + CELL * cells, GOAL])
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) / SPEED


def figures(runs: Mapping[str, Sequence[Run]], optimal: Mapping[str, float]) -> dict[str, float]:
    """The figures of all worlds, by name; a world without a successful run has no time."""
    scores, found = [], dict[str, float]()
    for world, made in runs.items():
        times = [run["seconds"] if run["ended"] == "reached" else None for run in made]
        scores.append([score(time, optimal[world]) for time in times])
        found[f"{world}.success"] = float(np.mean([time is not None for time in times]))
        if reached := [time for time in times if time is not None]:
            found[f"{world}.time_s"] = median(reached)
        found[f"{world}.score"] = float(np.mean(scores[-1]))
    mean = estimate(np.array(scores), plain_mean)
    every = [run["ended"] for made in runs.values() for run in made]
    return {
        "worlds": len(runs),
        "success": every.count("reached") / len(every),
        "contacts": every.count("contact") / len(every),
        "score.mean": mean.value,
        "score.low": mean.low,
        "score.high": mean.high,
        **found,
    }


def read_path(file: Path) -> Places:
    """(K, 2) cells of the reference path in a NumPy file; InputError if the file contains no path."""
    try:
        cells = np.array(np.load(file, allow_pickle=False), np.float64)
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; each world_N.world needs a path_N.npy next to it") from error
    except (OSError, ValueError, TypeError, EOFError, BadZipFile) as error:
        raise InputError(f"{file}: not a NumPy file of numbers; copy it from the data set again") from error
    if cells.ndim != 2 or cells.shape[1] != 2 or not np.isfinite(cells).all():
        raise InputError(f"{file}: a reference path must have shape (K, 2) and finite values, not {cells.shape}")
    return cells
