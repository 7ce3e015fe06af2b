"""Published worlds of the rescue leagues' virtual-robot competitions: one mission in each, scored by their rules."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from rich.table import Table

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.commands.settings import wanted_mission
from sarsim.episode import Episode
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.episodes import Job, leave, run_jobs, world_name
from scripts.benchmarks.settings import WorldsSettings

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
    """What the mission in each world explored, found and scored.

    Raises:
        InputError: there is no world, a mission failed, or a setting is wrong.
    """
    at_least(1, settings, "workers")
    wanted_mission("virtual", settings.minutes)
    jobs = [job_of(settings, world) for world in worlds_in(settings.worlds)]
    results = run_jobs(jobs, settings.runs, settings.workers, run_job, settings.minutes)
    if failed := [job.name for job, result in zip(jobs, results, strict=True) if result is None]:
        raise InputError(f"{', '.join(failed)} failed; see the .log files in {settings.runs}")
    runs = {world_name(job.config.arena): run for job, run in zip(jobs, results, strict=True) if run}
    found = {f"{name}.{key}": value for name, run in runs.items() for key, value in figures(run).items()}
    return Result(found, runs, table(runs))


def worlds_in(folder: Path) -> list[Path]:
    """The .world files below a folder, and the models there that none of these worlds includes.

    Raises:
        InputError: there are none.
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
        arena=str(world), robot=settings.robot, seed=settings.seed, mission="virtual", pipeline=settings.pipeline
    )
    return Job("worlds", "ours", config)


def run_job(job: Job, folder: Path, minutes: float) -> None:
    """Play a mission and write its figures to a folder."""
    leave(job, folder, lambda: _run(job.config, minutes))


def _run(config: EpisodeConfig, minutes: float) -> dict[str, Any]:
    begin = perf_counter()
    load_arena(config.arena)
    load_s = perf_counter() - begin
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        episode = Episode(replace(config, out=Path(out)), wanted_mission("virtual", minutes))
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


def table(runs: Mapping[str, Mapping[str, Any]]) -> Table:
    """A row for each world."""
    result = Table("world", title="Missions in worlds of the leagues")
    for column in ("loaded, s", "explored", "m²", "victims", "contacts", "S", "score", "ATE, m", "x real time"):
        result.add_column(column, justify="right")
    for name, run in runs.items():
        found = dict.fromkeys(FIGURES, np.nan) | figures(run)
        result.add_row(
            name,
            f"{found['load_s']:.1f}",
            f"{found['explored']:.0%}",
            f"{found['explored_m2']:.0f}",
            f"{found['found']:.0f}/{found['victims']:.0f}",
            f"{found['contacts']:.0f}",
            f"{found['discovered']:.0f}/{found['portals']:.0f}",
            f"{found['score']:.2f}",
            f"{found['ate_m']:.3f}",
            f"{found['real_time_factor']:.2f}",
        )
    return result
