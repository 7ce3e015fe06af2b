"""Exploration of many arenas, against two baselines: the nearest frontier on straight lines, and a random walk."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.errors import InputError
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.episodes import GROUPS, Job, Results, Strategy, configs, run_jobs
from scripts.benchmarks.exploration_table import (
    BASELINES,
    RATIO,
    group_figures,
    pairs,
    reports,
    rich_table,
    sections,
    seen90_ratio,
)
from scripts.benchmarks.settings import ExplorationSettings

BASELINE_STAGES = ("sim_time_s", "steps", "navigation", "exploration")
"""The parts of a baseline's report that are summarised."""
PICTURES = 2  # Number of worst runs per group whose pictures are copied next to the JSON file

Runs = Mapping[tuple[str, Strategy], Results]  # Results by group and strategy, None where a process failed


def measure(settings: ExplorationSettings) -> Result:
    """Run the missing episodes and summarise all; the baselines run without the victim detector.

    Raises:
        InputError: there is nothing to run, or a folder cannot be used.
    """
    at_least(0, settings, "nist", "esogu", "random")
    at_least(1, settings, "workers")
    jobs, runs = jobs_of(settings), settings.runs
    if not jobs:
        raise InputError("no arenas to explore; set --nist, --esogu or --random above 0, or give --raf")
    results = run_jobs(jobs, runs, settings.workers)
    found: dict[tuple[str, Strategy], list[dict[str, Any] | None]] = defaultdict(list)
    for job, result in zip(jobs, results, strict=True):
        found[job.group, job.strategy].append(result)
    figures, details = figures_of(found), _details(jobs, results)
    table = rich_table("exploration", figures, sections(figures, BASELINES if settings.baselines else ()))
    table.caption = _caption(figures, details)
    pictures = tuple(runs / f"{name}.png" for names in details["worst"].values() for name in names)
    return Result(figures, details, table, pictures)


def jobs_of(settings: ExplorationSettings) -> list[Job]:
    """The episodes of our strategy and of each baseline."""
    strategies: tuple[Strategy, ...] = ("ours", *(BASELINES if settings.baselines else ()))
    return [
        Job(group, strategy, config if strategy == "ours" else replace(config, detector=None))
        for group, config in configs(settings.episode, settings, settings.raf)
        for strategy in strategies
    ]


def figures_of(runs: Runs) -> dict[str, float]:
    """All figures of every group; those of a baseline begin with the baseline's name."""
    figures: dict[str, float] = {}
    for (group, strategy), results in runs.items():
        scored = reports(results)
        prefix = group if strategy == "ours" else f"{strategy}.{group}"
        if strategy != "ours":
            scored = [{stage: report[stage] for stage in BASELINE_STAGES} for report in scored]
        figures[f"{prefix}.runs"] = len(scored)
        figures[f"{prefix}.failed"] = sum(result is None for result in results)
        figures[f"{prefix}.seen90_runs"] = sum("t90_s" in report["exploration"] for report in scored)
        figures |= {f"{prefix}.{key}": value for key, value in group_figures(scored).items()}
    ratios = {group: _ratios(runs, group) for group in GROUPS}
    for group, values in ratios.items():
        if values:
            figures[f"{group}.{RATIO}.mean"] = float(np.mean(values))
            figures[f"{group}.{RATIO}.median"] = float(np.median(values))
            figures[f"{group}.{RATIO}.worst"] = max(values)
            figures[f"{group}.{RATIO}.pairs"] = len(values)
    if every := [ratio for values in ratios.values() for ratio in values]:
        figures[RATIO] = float(np.median(every))
        figures[f"{RATIO}.pairs"] = len(every)
    return figures


def _ratios(runs: Runs, group: str) -> list[float]:
    """Our time to see 90 % over the nearest frontier's, for each pair in which the nearest frontier saw 90 %."""
    both = pairs(runs.get((group, "ours"), ()), runs.get((group, "nearest_frontier"), ()))
    ratios = [seen90_ratio(ours, theirs) for ours, theirs in both]
    return [ratio for ratio in ratios if ratio is not None]


def _details(jobs: Sequence[Job], results: Results) -> dict[str, Any]:
    """The results that are not numbers: arenas left out, failed runs, and the worst runs of each group."""
    pairs = list(zip(jobs, results, strict=True))
    return {
        "left_out": {job.config.arena: r["left_out"] for job, r in pairs if r and "left_out" in r},
        "failed": [job.name for job, result in pairs if result is None],
        "worst": {
            group: worst
            for group in GROUPS
            if (worst := _worst([(j, r) for j, r in pairs if (j.group, j.strategy) == (group, "ours")]))
        },
    }


def _worst(pairs: Sequence[tuple[Job, dict[str, Any] | None]]) -> list[str]:
    """Names of the worst runs, by how often the robot tipped, then by explored fraction, then by collisions."""

    def goodness(report: Mapping[str, Any]) -> tuple[float, ...]:
        navigation = report["navigation"]
        return -navigation["tipped"], report["exploration"]["explored_fraction"], -navigation["collisions"]

    named = {job.name: goodness(r["report"]) for job, r in pairs if r and "report" in r}
    return sorted(named, key=lambda name: named[name])[:PICTURES]


def _caption(figures: Mapping[str, float], details: Mapping[str, Any]) -> str:
    """The text below the table: arenas left out, failed runs, and the median ratio of times."""
    lines = [f"{arena} skipped: {reason}" for arena, reason in details["left_out"].items()]
    lines += [f"{name} failed; see its log" for name in details["failed"]]
    if RATIO in figures:
        count = figures[f"{RATIO}.pairs"]
        lines.append(f"time to see 90 % relative to nearest frontier: {figures[RATIO]:.2f}, median of {count:.0f}")
    return "\n".join(lines)
