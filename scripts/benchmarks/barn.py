"""BARN's cylinder worlds, crossed using the whole pipeline, with the robot's own camera and localisation."""

import re
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.robot import Motion
from pipeline.run import TimeIsUpError
from pipeline.sink import Sink
from sarsim.commands.sweeps.statistics import estimate, plain_mean
from sarsim.episode import Episode
from sarsim.robots.model import robot_model
from sarsim.scoring.barn import GOAL, START, BarnJudge, optimal_seconds, read_path, score
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.runs import Job, run_all
from scripts.benchmarks.settings import BarnSettings

PUBLISHED = {"the challenge's baseline: DWA with a 270° lidar": 0.169, "best possible": 0.5}
"""Published scores, for comparison."""

Run = Mapping[str, Any]
"""How a run ended, its time in s, path length in m, and number of contacts."""


def measure(settings: BarnSettings) -> Result:
    """Success, contacts, time and score in each world, and the mean score with its interval.

    Raises:
        InputError: the folder has no world, a world has no reference path, a run failed, or a setting is wrong.
    """
    at_least(1, settings, "seeds")
    worlds = worlds_in(settings.worlds)
    robot_model(settings.robot)
    jobs = [job for name in worlds for job in jobs_in(settings, name)]
    runs = [result["run"] for result in run_all(jobs, settings, run_job)]
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
    """Cross a world."""
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        crossing = Crossing(replace(job.config, out=Path(out)))
        crossing.episode.run(show_progress=False)
    return {"run": crossing.result}


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
        """The result of the run; if the robot rather than the judge ended it, it is ``lost`` or ``given_up``."""
        judge, episode = self.judge, self.episode
        ended = judge.ended or ("lost" if episode.lost else "given_up")
        navigation = episode.report["navigation"]
        return {"ended": ended, "seconds": judge.seconds} | {
            key: navigation[key] for key in ("distance_m", "collisions", "mean_speed", "time_s") if key in navigation
        }


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
