"""Goals in unseen ground of random arenas: one run for each goal, from the start pose with empty maps."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from dm_control import mjcf

from pipeline.arrays import Places
from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.episode import Episode
from sarsim.ground_truth.true_surface import Survey
from sarsim.robots.model import robot_model
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.runs import Job, run_all
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
    jobs = list(islice(jobs_in(settings), settings.arenas * settings.goals))
    if not jobs:
        raise InputError(f"--robot {settings.robot}: no goal can be reached in random arenas; use a smaller robot")
    runs: dict[str, list[Run]] = {}
    for job, result in zip(jobs, run_all(jobs, settings, run_job), strict=True):
        runs.setdefault(job.config.arena, []).append(result["run"])
    made = [run for some in runs.values() for run in some]
    refused = [f"{arena}: {reason}" for arena, some in runs.items() for run in some for reason in run["refused"]]
    return Result(figures(made), {"runs": runs}, refused)


def jobs_in(settings: GoalsSettings) -> Iterator[Job]:
    """A run for each goal in random arenas in which goals can be sampled; the number of the goal is its seed."""
    base = EpisodeConfig(robot=settings.robot, labels="rules", detector=None)
    for seed in range(10 * settings.arenas):
        arena = f"random:{seed}"
        for n, (x, y) in enumerate(sample(arena, settings.goals, seed, settings.robot).tolist()):
            yield Job("random", replace(base, arena=arena, seed=n, goals=((x, y),)))


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


def run_job(job: Job) -> dict[str, Any]:
    """Drive to a goal."""
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        episode = Episode(replace(job.config, out=Path(out)))
        episode.run(show_progress=False)
    goals, collisions = episode.report["goals"], episode.report["navigation"]["collisions"]
    refused = [episode.lost] if episode.lost else goals["refused"]
    return {"run": {"goal": job.config.goals[0], "refused": refused, "collisions": collisions, **goals["each"][0]}}


def figures(runs: Sequence[Run]) -> dict[str, float]:
    """The figures over all runs, by name."""
    reached = [run for run in runs if not run["refused"]]
    found: dict[str, float] = {
        "goals": len(runs),
        "reached": len(reached) / len(runs),
        "contacts": sum(run["collisions"] > 0 for run in runs) / len(runs),
    }
    if reached:
        ratios = [run["way_m"] / run["shortest_m"] for run in reached]
        found["way_over_shortest.median"] = median(ratios)
        found["way_over_shortest.worst"] = max(ratios)
        found["time_s.median"] = median(run["time_s"] for run in reached)
    return found
