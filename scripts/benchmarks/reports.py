"""Figures computed from the reports of many episodes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.rescue_report.figures import figures

Report = Mapping[str, Any]

NOT_FIGURES = ("arena", "seed", "version", "config")
MORE_IS_BETTER = {
    "real_time_factor", "occupied_recall", "occupied_precision", "free_recall", "miou_four", "miou",
    "iou", "accuracy", "matched", "boxes_iou", "coverage", "reached", "recovered", "explored_fraction",
    "found", "mean_speed",
}  # fmt: skip
"""Parts of the names of figures whose worst value is the lowest; for all others, the worst value is the highest."""


def reports(results: Sequence[Mapping[str, Any] | None]) -> list[Report]:
    """The reports of the completed episodes."""
    return [result["report"] for result in results if result and "report" in result]


def pairs(
    ours: Sequence[Mapping[str, Any] | None], theirs: Sequence[Mapping[str, Any] | None]
) -> list[tuple[Report, Report]]:
    """Pairs of reports with the same arena and seed for which both episodes were completed."""
    both = [reports(pair) for pair in zip(ours, theirs, strict=False)]
    return [(pair[0], pair[1]) for pair in both if len(pair) == 2]


def flat_figures(report: Report) -> dict[str, float]:
    """All numbers in a report, by dotted name."""
    named = [pair for stage in report if stage not in NOT_FIGURES for pair in figures(stage, report[stage])]
    return {name: float(value) for name, value in named if isinstance(value, int | float)}


def group_figures(reports: Sequence[Report]) -> dict[str, float]:
    """Mean, median, worst and sum of every key over the reports that have it: ``<key>.<mean|median|worst|sum>``."""
    runs = [flat_figures(report) for report in reports]
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
