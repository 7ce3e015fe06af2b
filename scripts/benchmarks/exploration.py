"""Exploration of many arenas, compared with the nearest-frontier strategy as a baseline."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from sarsim.commands.sweeps.statistics import estimate
from scripts.benchmarks.common import Result
from scripts.benchmarks.reports import flat_figures, group_figures, pairs, reports
from scripts.benchmarks.runs import Job, Results, arena_name, failures, jobs_of, run_episode, run_jobs
from scripts.benchmarks.settings import ExplorationSettings

NEAREST_FRONTIER = "nearest_frontier"
GROUND_ONLY = "ground_only"
"""Our strategy without the victim detector, for comparison with the baseline, which has no detector."""
COMPARED_STAGES = ("sim_time_s", "steps", "navigation", "exploration")
"""Parts of the reports of the compared episodes that are summarised."""
WITHOUT_BASELINE = ("raf", "esogu_52x15")
"""Groups of large arenas, in which the baseline would take hours."""
RATIO = "seen90_vs_nearest_frontier"
T99_RATIO = "t99_vs_nearest_frontier"
PENALTY_FACTOR = (
    10.0  # Multiple of a run's duration that replaces the time to see 90% if the run never saw 90% (PAR10)
)
WORST_COUNT = 2  # Number of worst runs of a group that are named


def measure(settings: ExplorationSettings) -> Result:
    """Run the missing episodes, and summarise all episodes; compared episodes run without the victim detector.

    Raises:
        InputError: there is nothing to run, or a folder cannot be used.
    """
    # Set up complete episodes, and episodes of both strategies without the detector, with the same arenas and seeds.
    own = list(jobs_of(settings.episode, settings))
    groups = list(dict.fromkeys(job.group for job in own))
    compared = [job for job in own if settings.baselines and job.group not in WITHOUT_BASELINE]
    plain = [without_people(job, GROUND_ONLY, job.config.exploration) for job in compared]
    jobs = [*own, *plain, *(without_people(job, NEAREST_FRONTIER, NEAREST_FRONTIER) for job in compared)]
    # Measure.
    results = run_jobs(jobs, settings, partial(run_episode, pages=settings.runs))
    found: dict[str, list[dict[str, Any] | None]] = {}
    for job, result in zip(jobs, results, strict=True):
        found.setdefault(job.group, []).append(result)
    # Figures by group, and ratios to the nearest frontier.
    figures: dict[str, Any] = {}
    for group, of_group in found.items():
        figures |= figures_of(group, of_group)
    figures |= ratios(found, groups) | t99_ratio(found, groups)
    # A row for each arena.
    of_arenas, words = arena_figures(own, results[: len(own)])
    figures |= of_arenas
    left_out = {
        job.config.arena: r["left_out"] for job, r in zip(jobs, results, strict=True) if r and "left_out" in r
    }
    failed = failures(jobs, results)
    worst = {group: names for group in groups if (names := worst_of(group, jobs, results))}
    notes = [f"{arena} skipped: {reason}" for arena, reason in left_out.items()]
    notes += [f"{name} failed; see its log" for name in failed]
    return Result(figures, {"left_out": left_out, "failed": failed, "worst": worst, "words": words}, notes)


def arena_figures(jobs: Sequence[Job], results: Results) -> tuple[dict[str, float], dict[str, str]]:
    """The figures of the worst run in each arena, ``<arena>.<key of report.json>``, and why the run ended."""
    figures, words = dict[str, float](), dict[str, str]()
    reports_of: dict[str, list[Mapping[str, Any]]] = {}
    for job, result in zip(jobs, results, strict=True):
        if result and "report" in result:
            reports_of.setdefault(arena_name(job.config.arena), []).append(result["report"])
    for arena, of_arena in reports_of.items():
        worst = min(of_arena, key=goodness)
        figures |= {f"{arena}.{key}": value for key, value in flat_figures(worst).items()}
        words[f"{arena}.exploration.ended"] = worst["exploration"].get("ended", "").replace("_", " ")
    return figures, words


def without_people(job: Job, name: str, exploration: str) -> Job:
    """The episode of a strategy in the same arena with the same seed, without the detector, in the group ``name``."""
    config = replace(job.config, exploration=exploration, detector=None, detector_class=None)
    return Job(f"{name}.{job.group}", config)


def compared_pairs(found: Mapping[str, Results], group: str) -> list[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Pairs of our report and the baseline's of the same arena and seed in a group, both without the detector."""
    return pairs(*(found.get(f"{strategy}.{group}", ()) for strategy in (GROUND_ONLY, NEAREST_FRONTIER)))


def figures_of(group: str, results: Results) -> dict[str, float]:
    """The figures of a group."""
    scored = reports(results)
    if group.startswith((GROUND_ONLY, NEAREST_FRONTIER)):
        scored = [{stage: report[stage] for stage in COMPARED_STAGES} for report in scored]
    counts = {
        "runs": len(scored),
        "failed": sum(result is None for result in results),
        "seen90_runs": sum("t90_s" in report["exploration"] for report in scored),
    }
    return {f"{group}.{key}": value for key, value in {**counts, **group_figures(scored)}.items()}


def ratios(found: Mapping[str, Results], groups: Sequence[str]) -> dict[str, float]:
    """Ratio of our time to see 90% to the baseline's, by group and over all pairs in which the baseline saw 90%."""
    figures, every = dict[str, float](), list[float]()
    for group in groups:
        both = compared_pairs(found, group)
        if values := [ratio for pair in both if (ratio := seen90_ratio(*pair)) is not None]:
            figures[f"{group}.{RATIO}.mean"] = float(np.mean(values))
            figures[f"{group}.{RATIO}.median"] = float(np.median(values))
            figures[f"{group}.{RATIO}.worst"] = max(values)
            figures[f"{group}.{RATIO}.pairs"] = len(values)
            every += values
    if every:
        figures[RATIO] = float(np.median(every))
        figures[f"{RATIO}.pairs"] = len(every)
    return figures


def t99_ratio(found: Mapping[str, Results], groups: Sequence[str]) -> dict[str, float]:
    """Ratio of our time to see 99% to the baseline's, over all pairs in which both strategies saw 99%.

    Returns:
        The interquartile mean ``value`` with the 95% interval ``low`` to ``high``, and the number of ``pairs``; also
        the numbers of pairs in which ``only_ours`` or ``only_theirs`` saw 99%.
    """
    both = [pair for group in groups for pair in compared_pairs(found, group)]
    if not both:
        return {}
    times = np.array([[report["exploration"].get("t99_s", np.nan) for report in pair] for pair in both])
    has_seen = np.isfinite(times)
    counts = {
        "pairs": has_seen.all(axis=1).sum(),
        "only_ours": (has_seen[:, 0] & ~has_seen[:, 1]).sum(),
        "only_theirs": (has_seen[:, 1] & ~has_seen[:, 0]).sum(),
    }
    figures = {f"{T99_RATIO}.{name}": float(count) for name, count in counts.items()}
    if counts["pairs"]:
        ours, theirs = times[has_seen.all(axis=1)].T
        figures |= {f"{T99_RATIO}.{name}": v for name, v in estimate((ours / theirs)[:, None])._asdict().items()}
    return figures


def seen90_ratio(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> float | None:
    """Ratio of our time to see 90% of the drivable area to the baseline's, in the same arena with the same seed.

    If our run never saw 90%, ten times its duration is used; if the baseline never saw 90%, the ratio is None.
    """
    t_theirs = theirs["exploration"].get("t90_s")
    if t_theirs is None:
        return None
    return ours["exploration"].get("t90_s", PENALTY_FACTOR * ours["sim_time_s"]) / t_theirs


def worst_of(group: str, jobs: Sequence[Job], results: Results) -> list[str]:
    """Names of the worst runs, by how often the robot tipped, then by explored fraction, then by collisions."""
    how_good = {
        job.name: goodness(result["report"])
        for job, result in zip(jobs, results, strict=True)
        if job.group == group and result and "report" in result
    }
    return sorted(how_good, key=lambda name: how_good[name])[:WORST_COUNT]


def goodness(report: Mapping[str, Any]) -> tuple[float, ...]:
    """Key that sorts runs, the worst first: how often the robot tipped, explored fraction, contacts, duration."""
    navigation, explored = report["navigation"], report["exploration"]["explored_fraction"]
    return -navigation["tipped"], explored, -navigation["collisions"], -report["sim_time_s"]
