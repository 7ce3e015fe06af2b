"""Missions in published worlds of the rescue leagues' virtual-robot competitions, scored by the leagues' rules."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.episode import Episode
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result
from scripts.benchmarks.runs import Job, arena_name, run_jobs_or_raise
from scripts.benchmarks.settings import WorldsSettings

MINUTES = 20.0  # Time limit of each mission in simulated minutes
FIGURES: Mapping[str, Sequence[str]] = {
    "explored": ("exploration", "explored_fraction"),
    "victims": ("victims", "present"),
    "found": ("victims", "found"),
    "false_alarms": ("victims", "false_alarms"),
    "contacts": ("navigation", "collisions"),
    "legs": ("navigation", "legs"),
    "reached": ("navigation", "reached"),
    "ate_m": ("localisation", "ate_rmse_m"),
    "real_time_factor": ("real_time_factor",),
    "minutes": ("sim_time_s",),
    "portals": ("virtual", "portals", "present"),
    "discovered": ("virtual", "portals", "discovered"),
    "score": ("virtual", "total", "points"),
}
"""Figures of a world, and the path of keys to each in report.json."""


def measure(settings: WorldsSettings) -> Result:
    """The explored fractions, finds and scores of the mission in each world.

    Raises:
        InputError: there is no world, a mission failed, or a setting is wrong.
    """
    jobs = [job_of(settings, world) for world in worlds_in(settings.worlds)]
    names = [arena_name(job.config.arena) for job in jobs]
    runs = dict(zip(names, run_jobs_or_raise(jobs, settings, run_job), strict=True))
    return Result({f"{name}.{key}": value for name, run in runs.items() for key, value in figures(run).items()}, runs)


def worlds_in(folder: Path) -> list[Path]:
    """The .world files below a folder, and the models there that none of these worlds includes.

    Raises:
        InputError: the folder contains no world.
    """
    worlds = sorted(folder.rglob("*.world"))
    text = "".join(world.read_text(errors="replace") for world in worlds)
    models = [model for model in sorted(folder.rglob("model.sdf")) if f"model://{model.parent.name}" not in text]
    if not (worlds or models):
        raise InputError(f"--worlds {folder}: must contain at least one .world file or model.sdf")
    return worlds + models


def job_of(settings: WorldsSettings, world: Path) -> Job:
    """The mission in a world."""
    config = EpisodeConfig(
        arena=str(world),
        robot=settings.robot,
        seed=settings.seed,
        mission="virtual",
        minutes=MINUTES,
        pipeline=settings.pipeline,
    )
    return Job("worlds", config)


def run_job(job: Job) -> dict[str, Any]:
    """Run a mission, and return its report, the time to load the world, s, and the drivable area, m²."""
    begin = perf_counter()
    load_arena(job.config.arena)
    load_s = perf_counter() - begin
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        episode = Episode(replace(job.config, out=Path(out)))
        episode.run()
    surface = episode.score.coverage.surface
    ground_m2 = float(surface.drivable.sum()) * surface.grid.cell**2
    return {"report": episode.report, "load_s": load_s, "ground_m2": ground_m2}


def figures(run: Mapping[str, Any]) -> dict[str, float]:
    """The figures of a world."""
    found = {"load_s": run["load_s"], "ground_m2": run["ground_m2"]}
    for name, path in FIGURES.items():
        value: Any = run["report"]
        for key in path:
            value = value.get(key, {})
        if value != {}:
            found[name] = float(value)
    found["minutes"] /= 60
    return found | {"explored_m2": found["explored"] * found["ground_m2"]}
