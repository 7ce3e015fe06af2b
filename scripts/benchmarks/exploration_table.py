"""Figures of each group, computed from the reports of many episodes, and tables of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.table import Table

from pipeline.rescue_report.figures import figures
from scripts.benchmarks.episodes import GROUPS, Strategy

Report = Mapping[str, Any]

NOT_FIGURES = ("arena", "seed", "version", "config")
MORE_IS_BETTER = {
    "real_time_factor", "occupied_recall", "occupied_precision", "free_recall", "miou_four", "miou",
    "iou", "accuracy", "matched", "boxes_iou", "coverage", "reached", "recovered", "explored_fraction",
    "found", "mean_speed",
}  # fmt: skip
"""Name parts of figures whose worst value is the lowest; for all others, it is the highest."""

PENALTY = 10.0  # A run that never saw 90 % counts with this multiple of its duration (PAR10)


def reports(results: Sequence[Mapping[str, Any] | None]) -> list[Report]:
    """The reports of the completed episodes."""
    return [result["report"] for result in results if result and "report" in result]


def pairs(
    ours: Sequence[Mapping[str, Any] | None], theirs: Sequence[Mapping[str, Any] | None]
) -> list[tuple[Report, Report]]:
    """Pairs of reports with the same arena and seed for which both episodes were completed."""
    both = [reports(pair) for pair in zip(ours, theirs, strict=False)]
    return [(pair[0], pair[1]) for pair in both if len(pair) == 2]


def flat(report: Report) -> dict[str, float]:
    """All numbers in a report, by dotted name."""
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

    If we never saw 90 %, ten times our duration counts; if they never did, the ratio is None.
    """
    t_ours, t_theirs = (report["exploration"].get("t90_s") for report in (ours, theirs))
    if t_theirs is None:
        return None
    if t_ours is None:
        return PENALTY * ours["sim_time_s"] / t_theirs
    return t_ours / t_theirs


BASELINES: tuple[Strategy, ...] = ("nearest_frontier", "random_walk")
RATIO = "seen90_vs_nearest_frontier"

ROWS: Mapping[str, str] = {
    "runs": "runs",
    "explored, median": "exploration.explored_fraction.median",
    "explored, mean": "exploration.explored_fraction.mean",
    "explored, worst": "exploration.explored_fraction.worst",
    "90 % seen by": "seen90_runs",
    "90 % seen after, s, median": "exploration.t90_s.median",
    "done after, s, median": "sim_time_s.median",
    "mean speed, m/s, median": "navigation.mean_speed.median",
    "driving, s, median": "navigation.time_s.driving.median",
    "turning in place, s, median": "navigation.time_s.turning.median",
    "still, s, median": "navigation.time_s.still.median",
    "legs": "navigation.legs.sum",
    "legs reached": "navigation.reached.sum",
    "tipped": "navigation.tipped.sum",
    "stuck": "navigation.stuck.sum",
    "freed itself after being stuck": "navigation.recovered.sum",
    "collisions": "navigation.collisions.sum",
    "edges through walls": "topological_map.edges_through_walls.sum",
    "coverage, worst": "topological_map.coverage.worst",
    "nodes over greedy, median": "topological_map.nodes_vs_greedy.median",
    "path over shortest, median": "path_plan.cost_vs_grid.median.median",
    "victims": "victims.present.sum",
    "victims found": "victims.found.sum",
    "false alarms": "victims.false_alarms.sum",
    "real-time factor, worst": "real_time_factor.worst",
}
"""Names of the rows, and the figures in them."""

BASELINE_ROWS = (
    "explored, median",
    "explored, worst",
    "90 % seen by",
    "90 % seen after, s, median",
    "done after, s, median",
    "collisions",
)
RATIO_ROWS = {
    f"time to 90 % over nearest frontier, {what}": f"{RATIO}.{what}" for what in ("median", "worst", "pairs")
}

Rows = list[tuple[str, list[str]]]  # Each row has a name, and a cell for each group


def rows_of(figures: Mapping[str, float], keys: Mapping[str, str], baseline: str = "") -> Rows:
    """Rows of the figures that at least one group has, to four significant digits; a dash marks a missing figure.

    ``keys``: names of figures, without the group, by row name; ``baseline``: whose figures, empty for ours.
    """
    groups = groups_in(figures)
    label, prefix = (f"{baseline.replace('_', ' ')}: ", f"{baseline}.") if baseline else ("", "")
    rows = [(f"{label}{name}", [f"{prefix}{group}.{key}" for group in groups]) for name, key in keys.items()]
    return [
        (name, [f"{figures[key]:.4g}" if key in figures else "–" for key in row])
        for name, row in rows
        if any(key in figures for key in row)
    ]


def groups_in(figures: Mapping[str, float]) -> list[str]:
    """The groups that have figures, in the order of ``GROUPS``."""
    return [group for group in GROUPS if f"{group}.runs" in figures]


def sections(figures: Mapping[str, float], baselines: Sequence[str]) -> list[Rows]:
    """The table's sections: our strategy, each baseline, and the ratio."""
    few = {row: ROWS[row] for row in BASELINE_ROWS}
    theirs = [rows_of(figures, few, baseline) for baseline in baselines]
    return [rows_of(figures, ROWS), *theirs, rows_of(figures, RATIO_ROWS)]


def rich_table(title: str, figures: Mapping[str, float], sections: Sequence[Rows]) -> Table:
    """The sections as a table for the terminal, with a column for each group."""
    table = Table("", *groups_in(figures), title=title)
    for section in sections:
        for name, cells in section:
            table.add_row(name, *cells)
        table.add_section()
    return table
