"""Loop closures in worlds where they matter, measured by replaying recorded tours with localisation alone."""

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.localisation.config import LocalisationConfig
from sarsim.commands.cli import progress
from sarsim.jobs import locked, make_engine
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.loops.replay import replay
from scripts.benchmarks.loops.revisits import revisits
from scripts.benchmarks.loops.scores import APART, LENGTHS, scores
from scripts.benchmarks.loops.tours import Tour, record
from scripts.benchmarks.loops.worlds import world_name
from scripts.benchmarks.settings import LoopsSettings

SUMMED = "revisits", "constraints", "false", "closures", "false_closures"
MEDIANS = "ate_m", "ate_percent", "path_m", "keyframes", "frame_ms", "settle_ms"


@dataclass(frozen=True)
class TourJob:
    """A tour to record and to replay.

    Attributes:
        world: one of ``WORLDS``, or an arena.
        seed: determines the world's details, the path and the noise.
        length: length of the tour, m.
    """

    world: str
    seed: int
    length: float

    @property
    def name(self) -> str:
        """Name of the tour's files, without suffix."""
        return f"{world_name(self.world)}-{self.seed}-{self.length:g}"


def measure(settings: LoopsSettings) -> Result:
    """Record the missing tours, replay the tours without a result, and summarise all tours.

    Raises:
        InputError: there is nothing to drive, an arena cannot be loaded, or the folder cannot be used.
    """
    at_least(1, settings, "workers")
    if not (settings.worlds and settings.seeds):
        raise InputError("--worlds and --seeds: give at least one of each")
    jobs = [TourJob(world, seed, settings.length) for world in settings.worlds for seed in settings.seeds]
    folder = settings.runs
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--runs {folder}: cannot be created: {error.strerror or error}") from error
    with locked(folder) as lock, progress() as bars:
        waiting = [job for job in jobs if not (folder / f"{job.name}.json").exists()]
        bar = bars.add_task("tours", total=len(waiting))
        with closing(make_engine(workers=settings.workers)(run_tour, waiting, lock)) as outcomes:
            for _ in outcomes:
                bars.advance(bar)
    files = [folder / f"{job.name}.json" for job in jobs]
    if missing := [file.stem for file in files if not file.exists()]:
        raise InputError(f"{', '.join(missing)} failed; delete their files in {folder} to try again")
    tours = [json.loads(file.read_text()) for file in files]
    by_world: dict[str, list[Mapping[str, Any]]] = {}
    for job, tour in zip(jobs, tours, strict=True):
        by_world.setdefault(world_name(job.world), []).append(tour)
    figures: dict[str, float] = {}
    for name, of_world in by_world.items():
        figures |= {f"{name}.{key}": value for key, value in figures_of(of_world).items()}
    names = {job.name: tour for job, tour in zip(jobs, tours, strict=True)}
    return Result({"worlds": len(by_world)} | figures_of(tours) | figures, {"tours": names})


def run_tour(job: TourJob, folder: Path) -> None:
    """Record a tour, unless its file exists, replay it, and write its scores as JSON."""
    file = folder / f"{job.name}.npz"
    if not file.exists():
        record(job.world, job.seed, job.length, file)
    tour = Tour.load(file)
    found = scores(tour, replay(tour, LocalisationConfig()), revisits(tour))
    with atomic_write(folder / f"{job.name}.json") as part:
        part.write_text(json.dumps(found, indent=1, default=float))


def figures_of(tours: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Sums of counts and medians of other figures over tours, and the mean NEES of all compared poses."""
    figures = {key: float(sum(tour[key] for tour in tours)) for key in SUMMED}
    figures |= {key: float(np.median([tour[key] for tour in tours])) for key in MEDIANS}
    if figures["revisits"]:
        figures["linked"] = sum(tour["linked"] for tour in tours) / figures["revisits"]
    for key, names in (("nees", tuple(LENGTHS)), ("relative_nees", tuple(map(str, APART)))):
        for name in names:
            if values := [value for tour in tours for value in tour[key].get(name, ())]:
                figures[f"{key}.{name}"] = float(np.mean(values))
    return figures
