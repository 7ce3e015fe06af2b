"""Entries and tables of the leaderboard, of rows worked out by hand."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps.leaderboard import (
    SORT_COLUMN,
    TABLE_COLUMNS,
    Entry,
    boards,
    entry_of,
    read_entry,
    write_entry,
)

ORIGIN = {"commit": "abc", "version": "1", "processor": "P", "processor_s": 2.0}
ABOUT = ORIGIN | {"arenas": ("toys",), "seeds": (0, 1)}


def row(arena: str, seed: int, t99: float | None, end: float = 100.0, **more: Any) -> dict[str, Any]:
    seen = {"explored_fraction": 1.0, "auc_time": end / 2, "auc_way": end / 4} | ({"t99_s": t99} if t99 else {})
    figures = {"sim_time_s": end, "navigation.distance_m": end / 2, "steps": 3, "checksum": arena}
    return figures | {f"exploration.{k}": v for k, v in seen.items()} | {"arena": arena, "seed": seed} | more


def entry(method: str, times: list[float | None], **more: Any) -> Entry:
    pairs = [(arena, seed) for arena in "ab" for seed in (0, 1)]
    rows = [row(*pair, time, **more) for pair, time in zip(pairs, times, strict=True)]
    return entry_of(rows, **(ABOUT | {"method": method}))


FAST, SLOW = entry("fast", [10, 20, 30, None]), entry("nearest_frontier", [20, 20, 60, None], end=200.0)


def test_an_entry_comes_back_from_its_file(tmp_path: Path) -> None:
    assert read_entry(write_entry(FAST, tmp_path / "new")) == replace(FAST, rows=tuple(full(FAST)))


def full(one: Entry) -> list[dict[str, Any]]:
    """The rows with None for what an episode lacks, as columns have it."""
    keys = dict.fromkeys(key for r in one.rows for key in r)
    return [{key: r.get(key) for key in keys} for r in one.rows]


def test_times_are_compared_pair_by_pair() -> None:
    ratios = TABLE_COLUMNS["T_99 over nearest_frontier"]([FAST, SLOW])
    assert ratios[0].tolist() == [[0.5, 1.0], [0.5, 1.0]]
    assert TABLE_COLUMNS["T_99 over nearest_frontier"]([FAST]) == []
    assert TABLE_COLUMNS[SORT_COLUMN]([FAST])[0].tolist() == [[10, 20], [30, np.inf]]


def test_shares_are_means_up_to_the_longest_end_of_all_entries() -> None:
    fast, slow = TABLE_COLUMNS["explored, mean over time"]([FAST, SLOW])
    assert slow.tolist() == [[0.5, 0.5]] * 2
    assert fast.tolist() == [[(50 + 100) / 200] * 2] * 2


def test_a_failed_episode_saw_nothing() -> None:
    lost = entry_of([{"arena": "a", "seed": s, "failed": "threw"} for s in (0, 1)], **(ABOUT | {"method": "lost"}))
    known = replace(FAST, rows=FAST.rows[:2])
    assert TABLE_COLUMNS["explored, mean over time"]([known, lost])[1].tolist() == [[0.0, 0.0]]
    assert TABLE_COLUMNS[SORT_COLUMN]([lost])[0].tolist() == [[np.inf, np.inf]]


def test_people_are_a_share_of_those_in_the_arena_and_arenas_without_do_not_count() -> None:
    rows = [row("a", 0, 1.0), row("a", 1, 1.0)]
    rows += [row("b", seed, 1.0) | {"victims.present": 2, "victims.found": seed} for seed in (0, 1)]
    some, lost = entry_of(rows, **(ABOUT | {"method": "some"})), entry("nearest_frontier", [1.0] * 4)
    column = TABLE_COLUMNS["people found"]
    assert [found.tolist() for found in column([some, lost])] == [[[0.0, 0.5]], [[0.0, 0.0]]]
    assert column([lost]) == []
    failed = {"arena": "b", "seed": 0, "failed": "threw"}
    assert [found.tolist() for found in column([entry_of([failed, rows[3]], **ABOUT, method="m")])] == [[[0.0, 0.5]]]


def test_a_map_that_no_episode_has_is_no_column() -> None:
    column = TABLE_COLUMNS["map F1, 5 cm"]
    assert column([FAST]) == []
    with_map = entry("mapped", [1.0] * 4, **{"semantic_map.f1_5cm": 0.9})
    assert [found.tolist() for found in column([with_map, FAST])] == [[[0.9, 0.9]] * 2, [[0.0, 0.0]] * 2]


def test_pace_is_shown_of_entries_that_have_it_and_a_failed_episode_went_nowhere() -> None:
    figures = {"navigation.mean_speed": 0.25, "navigation.time_s.turning": 10.0}
    rows = [row("a", 0, 1.0, **figures), {"arena": "a", "seed": 1, "failed": "threw"}]
    paced = entry_of(rows, **(ABOUT | {"method": "paced"}))
    older = replace(FAST, rows=FAST.rows[:2])
    speed, turning = TABLE_COLUMNS["mean speed, m/s"], TABLE_COLUMNS["turning in place"]
    assert [found.tolist() for found in speed([paced, older])] == [[[0.25, 0.0]], [[np.inf, np.inf]]]
    assert [found.tolist() for found in turning([paced, older])] == [[[0.1, np.inf]], [[np.inf, np.inf]]]
    assert speed([older]) == turning([older]) == []


def test_the_fastest_comes_first_and_other_arenas_have_a_table_of_their_own() -> None:
    other = replace(FAST, rows=tuple(r | {"checksum": "changed"} for r in FAST.rows))
    tables = list(boards([SLOW, FAST, other]))
    assert sorted([r[0] for r in table.rows] for table in tables) == [["fast"], ["fast", "nearest_frontier"]]
    (pair,) = (table for table in tables if len(table.rows) == 2)
    assert pair.title == "toys: 2 arenas, seeds 0 1"
    assert "path over oracle" not in pair.headings and "map F1, 10 cm" not in pair.headings
    assert pair.rows[0][pair.headings.index(SORT_COLUMN)].startswith("25 (")
    assert pair.rows[0][-2:] == ("0", "abc, P")


def test_a_title_counts_one_arena_and_one_seed() -> None:
    single = replace(FAST, seeds=(0,), rows=FAST.rows[:1])
    (table,) = boards([single])
    assert table.title == "toys: 1 arena, seed 0"


@pytest.mark.parametrize(
    "change", [{"rows": {}}, {"seeds": [0]}, {"rows": {"arena": ["a"], "seed": [0, 1]}}, {"x": 1}]
)
def test_a_file_that_is_no_entry(tmp_path: Path, change: dict[str, Any]) -> None:
    path = write_entry(FAST, tmp_path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=path.name):
        read_entry(path)
