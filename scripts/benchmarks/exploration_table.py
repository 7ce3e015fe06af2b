"""The table of the exploration's benchmark: a column for each group; ours first, then the baselines."""

from collections.abc import Mapping, Sequence

from rich.table import Table

from sarsim.scripts.benchmarks.episodes import GROUPS, Strategy

BASELINES: tuple[Strategy, ...] = ("nearest_frontier", "random_walk")
RATIO = "seen90_vs_nearest_frontier"

ROWS: Mapping[str, str] = {
    "runs": "runs",
    "explored, median": "exploration.explored_fraction.median",
    "explored, mean": "exploration.explored_fraction.mean",
    "explored, worst": "exploration.explored_fraction.worst",
    "90 % seen by": "seen90_runs",
    "90 % seen after, s, median": "exploration.seen90_s.median",
    "done after, s, median": "sim_time_s.median",
    "legs": "navigation.legs.sum",
    "legs reached": "navigation.reached.sum",
    "tipped": "navigation.tipped.sum",
    "stuck": "navigation.stuck.sum",
    "got away after being held": "navigation.recovered.sum",
    "collisions": "navigation.collisions.sum",
    "edges through walls": "topological_map.edges_through_walls.sum",
    "coverage, worst": "topological_map.coverage.worst",
    "nodes over greedy, median": "topological_map.nodes_vs_greedy.median",
    "way over optimum, median": "path_plan.cost_vs_grid.median.median",
    "victims": "victims.present.sum",
    "victims found": "victims.found.sum",
    "false alarms": "victims.false_alarms.sum",
    "real-time factor, worst": "real_time_factor.worst",
}
"""And the figures in them."""

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

Rows = list[tuple[str, list[str]]]
"""Of a name and a cell for each group."""


def rows_of(figures: Mapping[str, float], keys: Mapping[str, str], baseline: str = "") -> Rows:
    """Rows of those figures that are there for any group, in four digits; a dash stands for none.

    ``keys``, without the group, by the names of the rows; ``baseline`` that the figures are of, empty for ours.
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
    """The groups that figures are of, in their order."""
    return [group for group in GROUPS if f"{group}.runs" in figures]


def sections(figures: Mapping[str, float], baselines: Sequence[str]) -> list[Rows]:
    """Rows of ours, of each baseline, and of the ratio."""
    few = {row: ROWS[row] for row in BASELINE_ROWS}
    theirs = [rows_of(figures, few, baseline) for baseline in baselines]
    return [rows_of(figures, ROWS), *theirs, rows_of(figures, RATIO_ROWS)]


def rich_table(title: str, figures: Mapping[str, float], sections: Sequence[Rows]) -> Table:
    """For the terminal."""
    table = Table("", *groups_in(figures), title=title)
    for section in sections:
        for name, cells in section:
            table.add_row(name, *cells)
        table.add_section()
    return table
