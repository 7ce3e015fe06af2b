"""Loop closures in worlds where they matter, measured by replaying recorded tours with localisation alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result
from scripts.benchmarks.loops.replay import replay
from scripts.benchmarks.loops.revisits import revisits
from scripts.benchmarks.loops.scores import KEYFRAME_GAPS, PATH_RANGES, scores
from scripts.benchmarks.loops.tours import Tour, record
from scripts.benchmarks.loops.worlds import world_name
from scripts.benchmarks.runs import Job, run_jobs_or_raise
from scripts.benchmarks.settings import LoopsSettings

SUMMED = "revisits", "constraints", "false", "closures", "false_closures"
MEDIANS = "ate_m", "ate_percent", "path_m", "keyframes", "frame_ms", "settle_ms"


@dataclass(frozen=True)
class TourJob(Job):
    """A tour to record and to replay; its group is the world's name.

    Its arena is one of this benchmark's worlds, or any arena that ``--arena`` takes.

    Attributes:
        length: length of the tour, m.
    """

    length: float

    @property
    def name(self) -> str:
        """Name of the tour's files, without suffix."""
        return f"{self.group}-{self.config.seed}-{self.length:g}"

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that the tour's scores depend on, as JSON values."""
        return super().settings | {"length": self.length}


def measure(settings: LoopsSettings) -> Result:
    """Record the missing tours, replay the tours without a result, and summarise all tours.

    Raises:
        InputError: there is nothing to drive, an arena cannot be loaded, or the folder cannot be used.
    """
    if not (settings.worlds and settings.seeds):
        raise InputError("--worlds and --seeds: give at least one of each")
    jobs = [
        TourJob(world_name(world), EpisodeConfig(arena=world, seed=seed), settings.length)
        for world in settings.worlds
        for seed in settings.seeds
    ]
    results = run_jobs_or_raise(jobs, settings, partial(run_tour, folder=settings.runs))
    tours = [result["scores"] for result in results]
    by_world: dict[str, list[Mapping[str, Any]]] = {}
    for job, tour in zip(jobs, tours, strict=True):
        by_world.setdefault(job.group, []).append(tour)
    figures: dict[str, float] = {}
    for name, of_world in by_world.items():
        figures |= {f"{name}.{key}": value for key, value in figures_of(of_world).items()}
    names = {job.name: tour for job, tour in zip(jobs, tours, strict=True)}
    return Result({"worlds": len(by_world)} | figures_of(tours) | figures, {"tours": names})


def run_tour(job: TourJob, folder: Path) -> dict[str, Any]:
    """Record a tour, unless its file exists, replay it, and return its scores."""
    file = folder / f"{job.name}.npz"
    if not file.exists():
        record(job.config.arena, job.config.seed, job.length, file)
    tour = Tour.load(file)
    return {"scores": scores(tour, replay(tour, job.config.pipeline.localisation), revisits(tour))}


def figures_of(tours: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Sums of counts and medians of other figures over tours, and the mean NEES of all compared poses."""
    figures = {key: float(sum(tour[key] for tour in tours)) for key in SUMMED}
    figures |= {key: float(np.median([tour[key] for tour in tours])) for key in MEDIANS}
    if figures["revisits"]:
        figures["linked"] = sum(tour["linked"] for tour in tours) / figures["revisits"]
    for key, names in (("nees", tuple(PATH_RANGES)), ("relative_nees", tuple(map(str, KEYFRAME_GAPS)))):
        for name in names:
            if values := [value for tour in tours for value in tour[key].get(name, ())]:
                figures[f"{key}.{name}"] = float(np.mean(values))
    return figures
