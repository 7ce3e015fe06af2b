"""From the reports of many episodes to figures of each group."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sarsim.scripts.tables import figures

Report = Mapping[str, Any]

NOT_FIGURES = ("arena", "seed", "version", "config")
MORE_IS_BETTER = {
    "real_time_factor", "occupied_recall", "occupied_precision", "free_recall", "miou_four", "miou",
    "iou", "accuracy", "matched", "boxes_iou", "coverage", "reached", "recovered", "explored_fraction",
    "found",
}  # fmt: skip
"""Parts of names of figures whose worst value is the lowest; of all others it is the highest."""

PENALTY = 10.0
"""A run that never saw enough counts as if it had taken so many times its duration (PAR10)."""


def reports(results: Sequence[Mapping[str, Any] | None]) -> list[Report]:
    """The reports of the episodes that were run."""
    return [result["report"] for result in results if result and "report" in result]


def pairs(
    ours: Sequence[Mapping[str, Any] | None], theirs: Sequence[Mapping[str, Any] | None]
) -> list[tuple[Report, Report]]:
    """Reports of the same arena and seed, where both were run."""
    both = [reports(pair) for pair in zip(ours, theirs, strict=False)]
    return [(pair[0], pair[1]) for pair in both if len(pair) == 2]


def flat(report: Report) -> dict[str, float]:
    """All numbers of a report by their dotted names."""
    named = [pair for stage in report if stage not in NOT_FIGURES for pair in figures(stage, report[stage])]
    return {name: float(value) for name, value in named if isinstance(value, int | float)}


def group_figures(reports: Sequence[Report]) -> dict[str, float]:
    """Mean, median, worst and sum of every key over the reports that have it: ``<key>.<mean|median|worst|sum>``."""
    runs = [flat(report) for report in reports]
    result: dict[str, float] = {}
    for key in dict.fromkeys(name for run in runs for name in run):
        values = np.array([run[key] for run in runs if key in run])
        worst = values.min() if MORE_IS_BETTER & set(key.split(".")) else values.max()
        result |= {
            f"{key}.mean": float(values.mean()),
            f"{key}.median": float(np.median(values)),
            f"{key}.worst": float(worst),
            f"{key}.sum": float(values.sum()),
        }
    return result


def seen90_ratio(ours: Report, theirs: Report) -> float | None:
    """Our time to see 90 % of the drivable area over theirs, in the same arena with the same seed.

    If we did not see it, ten times our duration counts. None if they did not: there is nothing to compare with.
    """
    t_ours, t_theirs = (report["exploration"].get("seen90_s") for report in (ours, theirs))
    if t_theirs is None:
        return None
    if t_ours is None:
        return PENALTY * ours["sim_time_s"] / t_theirs
    return t_ours / t_theirs
