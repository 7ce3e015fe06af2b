"""Goals in unseen ground of random arenas: one run for each goal, from the start pose with empty maps."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count, islice
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from dm_control import mjcf
from rich.table import Table

from pipeline.arrays import Places
from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.episode import Episode
from sarsim.ground_truth.true_surface import Survey
from sarsim.robots.model import robot_model
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.episodes import Job, leave, run_jobs
from scripts.benchmarks.settings import GoalsSettings

NEAREST, FARTHEST = 5.0, 15.0  # m, straight-line distance from the start to a goal

Run = Mapping[str, Any]
"""The goal's entry in report.json, the reasons for refusing it, if any, and the number of collisions."""


def measure(settings: GoalsSettings) -> Result:
    """The share of goals reached, and path length over the shortest possible.

    Raises:
        InputError: a setting is wrong, the robot can reach no goal in the random arenas, or a run failed.
    """
    at_least(1, settings, "arenas", "goals")
    robot_model(settings.robot)
    sampled = islice(_arenas_with_goals(settings), settings.arenas)
    jobs = [job for arena, goals in sampled for job in _jobs(settings, arena, goals)]
    if not jobs:
        raise InputError(f"--robot {settings.robot}: no goal can be reached in random arenas; use a smaller robot")
    results = run_jobs(jobs, settings.runs, settings.workers, run_job)
    if failed := [job.name for job, result in zip(jobs, results, strict=True) if result is None]:
        raise InputError(f"{', '.join(failed)} failed; see the .log files in {settings.runs}")
    runs: dict[str, list[Run]] = {}
    for job, result in zip(jobs, results, strict=True):
        if result:
            runs.setdefault(job.config.arena, []).append(result["run"])
    found = figures(runs)
    return Result(found, {"runs": runs}, table(runs, found))


def _arenas_with_goals(settings: GoalsSettings) -> Iterator[tuple[str, Places]]:
    """Names of random arenas in which goals can be sampled, each with its goals, (N, 2) m."""
    for seed in islice(count(), 10 * settings.arenas):
        places = sample(f"random:{seed}", settings.goals, seed, settings.robot)
        if len(places):
            yield f"random:{seed}", places


def sample(arena: str, number: int, seed: int, robot: str) -> Places:
    """(N, 2) random places, m, that the robot can drive to, 5 to 15 m from the start; empty if there are none."""
    world = load_arena(arena)
    physics = mjcf.Physics.from_mjcf_model(world.mjcf_model)
    start = world.T_world_start[:3, 3]
    surface = Survey(physics.model.ptr, physics.data.ptr, robot=robot_model(robot)).surface_from(start)
    places = surface.grid.centre_of(np.argwhere(surface.drivable))
    away = np.linalg.norm(places - start[:2], axis=1)
    places = places[(away >= NEAREST) & (away <= FARTHEST)]
    return places[np.random.default_rng(seed).integers(len(places), size=number)] if len(places) else places


def _jobs(settings: GoalsSettings, arena: str, goals: Places) -> list[Job]:
    """A run for each goal; the number of the goal is its seed."""
    base = EpisodeConfig(arena=arena, robot=settings.robot, labels="rules", detector=None)
    return [Job("random", "ours", replace(base, seed=n, goals=((x, y),))) for n, (x, y) in enumerate(goals.tolist())]


def run_job(job: Job, folder: Path) -> None:
    """Drive to a goal and write the result to a folder."""
    leave(job, folder, lambda: {"run": _run(job.config)})


def _run(config: EpisodeConfig) -> Run:
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        episode = Episode(replace(config, out=Path(out)))
        episode.run(show_progress=False)
    goals, navigation = episode.report["goals"], episode.report["navigation"]
    refused = [episode.lost] if episode.lost else goals["refused"]
    return {"goal": config.goals[0], "refused": refused, "collisions": navigation["collisions"], **goals["each"][0]}


def figures(runs: Mapping[str, Sequence[Run]]) -> dict[str, float]:
    """The figures over all runs, by name."""
    made = [run for some in runs.values() for run in some]
    reached = [run for run in made if not run["refused"]]
    ratios = [run["way_m"] / run["shortest_m"] for run in reached]
    found: dict[str, float] = {
        "goals": len(made),
        "reached": len(reached) / len(made),
        "contacts": sum(run["collisions"] > 0 for run in made) / len(made),
    }
    if reached:
        found["way_over_shortest.median"], found["way_over_shortest.worst"] = median(ratios), max(ratios)
        found["time_s.median"] = median(run["time_s"] for run in reached)
    return found


def table(runs: Mapping[str, Sequence[Run]], found: Mapping[str, float]) -> Table:
    """A row for each arena and one for all; the note says why goals were refused."""
    result = Table("arena", title="Goals in unseen ground")
    for column in ("reached", "path over shortest, median", "s, median"):
        result.add_column(column, justify="right")
    result.add_column("note")
    for arena, made in runs.items():
        own, refused = figures({arena: made}), [line for run in made for line in run["refused"]]
        result.add_row(arena, *_shown(own), "; ".join(refused))
    result.add_row("all", *_shown(found), f"{found['contacts']:.1%} with a contact")
    return result


def _shown(found: Mapping[str, float]) -> list[str]:
    ratio, seconds = found.get("way_over_shortest.median"), found.get("time_s.median")
    return [f"{found['reached']:.0%}", *("–" if x is None else f"{x:.2f}" for x in (ratio, seconds))]
