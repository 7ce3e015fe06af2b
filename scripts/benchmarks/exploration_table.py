"""The table of the exploration's benchmark: a column for each group; ours first, then the baselines."""

from collections.abc import Iterator, Mapping, Sequence

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


def groups_in(figures: Mapping[str, float]) -> list[str]:
    """The groups that figures are of, in their order."""
    return [group for group in GROUPS if f"{group}.runs" in figures]


def sections(figures: Mapping[str, float], baselines: Sequence[str]) -> Iterator[list[tuple[str, list[str]]]]:
    """Rows of a name and a cell per group: ours, each baseline's, the ratio; rows without a figure are left out."""
    groups = groups_in(figures)
    rows = [(row, [f"{group}.{key}" for group in groups]) for row, key in ROWS.items()]
    yield _filled(figures, rows)
    for baseline in baselines:
        names = [(row, [f"{baseline}.{group}.{ROWS[row]}" for group in groups]) for row in BASELINE_ROWS]
        yield _filled(figures, [(f"{baseline.replace('_', ' ')}: {row}", keys) for row, keys in names])
    if "nearest_frontier" in baselines:
        yield [
            (
                f"time to 90 % over nearest frontier, {what}",
                _cells(figures, [f"{g}.{RATIO}.{what}" for g in groups]),
            )
            for what in ("median", "worst", "pairs")
        ]


def rich_table(figures: Mapping[str, float], baselines: Sequence[str]) -> Table:
    """For the terminal."""
    table = Table("", *groups_in(figures), title="exploration")
    for section in sections(figures, baselines):
        for name, cells in section:
            table.add_row(name, *cells)
        table.add_section()
    return table


def markdown_table(figures: Mapping[str, float], baselines: Sequence[str]) -> str:
    """For the documents."""
    groups = groups_in(figures)
    lines = [["", *groups], ["---"] * (1 + len(groups))]
    lines += [[name, *cells] for section in sections(figures, baselines) for name, cells in section]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _filled(
    figures: Mapping[str, float], rows: Sequence[tuple[str, Sequence[str]]]
) -> list[tuple[str, list[str]]]:
    return [(name, _cells(figures, keys)) for name, keys in rows if any(key in figures for key in keys)]


def _cells(figures: Mapping[str, float], keys: Sequence[str]) -> list[str]:
    """Four digits, a dash where there is no figure."""
    return [f"{figures[key]:.4g}" if key in figures else "–" for key in keys]
