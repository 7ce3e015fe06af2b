"""Leaderboard entries, one JSON file per method, and the tables made from them."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from pipeline.rescue_report.figures import figure_text
from sarsim.commands.sweeps.episodes import Row
from sarsim.commands.sweeps.statistics import Estimate, estimate
from sarsim.scoring.progress import mean_up_to

REFERENCE = "nearest_frontier"
"""The method with which the other methods' times are compared."""
ENTRY_KEYS = (
    "checksum", "sim_time_s", "navigation.distance_m", "navigation.mean_speed", "navigation.time_s.driving",
    "navigation.time_s.turning", "navigation.time_s.backing", "navigation.time_s.still", "navigation.time_s.narrow",
    "navigation.time_s.ramp", "exploration.explored_fraction", "exploration.t90_s",
    "exploration.t99_s", "exploration.auc_time", "exploration.auc_way", "exploration.path_over_oracle",
    "exploration.time_over_oracle", "exploration.time_over_physical", "semantic_map.f1_5cm", "semantic_map.f1_10cm",
    "victims.present", "victims.found", "failed",
)  # fmt: skip
"""Keys of a row that an entry keeps."""
ENTRY_DIGITS = 6
"""Number of significant digits that an entry keeps."""
END_KEYS = {"time": "sim_time_s", "way": "navigation.distance_m"}
"""Key of an episode's total time, s, and of its total distance, m."""
NOTHING_SEEN = {"explored_fraction": 0.0, "auc_time": 0.0, "auc_way": 0.0}
"""Figures of an episode that failed."""

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Entry:
    """The results of one method on one set of arenas.

    Attributes:
        method: name of the method.
        arenas: the arenas, as the user named them.
        seeds: seeds of the episodes in each arena.
        commit: state of the code; empty if unknown.
        version: version of sarsim.
        processor: name of the processor used.
        processor_s: processor time of all episodes, s.
        rows: rows of the episodes, without the method.
    """

    method: str
    arenas: tuple[str, ...]
    seeds: tuple[int, ...]
    commit: str
    version: str
    processor: str
    processor_s: float
    rows: tuple[Row, ...]

    @property
    def comparison_key(self) -> tuple[tuple[str, ...], tuple[int, ...], str]:
        """The properties in which comparable entries agree: arenas, seeds, and a digest of all checksums."""
        sums = sorted({f"{row['arena']} {row['checksum']}" for row in self.rows if row.get("checksum")})
        return self.arenas, self.seeds, hashlib.sha256("\n".join(sums).encode()).hexdigest()

    def values(self, key: str, missing: float) -> Values:
        """(arenas, seeds) values of a figure, in its own unit; ``missing`` where an episode lacks it."""
        names = list(dict.fromkeys(row["arena"] for row in self.rows))
        found = np.full((len(names), len(self.seeds)), missing)
        for row in self.rows:
            value = row.get(key)
            found[names.index(row["arena"]), self.seeds.index(row["seed"])] = missing if value is None else value
        return found


def entry_of(rows: Iterable[Row], **about: Any) -> Entry:
    """An entry from the rows of a method's episodes; ``about`` holds the entry's other fields."""
    kept = [
        {"arena": row["arena"], "seed": row["seed"]} | {key: _rounded(row[key]) for key in ENTRY_KEYS if key in row}
        for row in rows
    ]
    return Entry(rows=tuple(kept), **about)


def _rounded(value: Any) -> Any:
    return float(f"{value:.{ENTRY_DIGITS}g}") if isinstance(value, float) else value


def write_entry(entry: Entry, folder: Path) -> Path:
    """Write an entry's file to a folder, replacing an earlier one for the same method and arenas."""
    name = "-".join("".join(c if c.isalnum() or c in "._" else "_" for c in w) for w in (entry.method, *entry.arenas))
    folder.mkdir(parents=True, exist_ok=True)
    content = asdict(entry)
    keys = list(dict.fromkeys(key for row in entry.rows for key in row))
    content["rows"] = {key: [row.get(key) for row in entry.rows] for key in keys}
    with atomic_write(path := folder / f"{name[:120]}.json") as part:
        part.write_text(json.dumps(content, indent=None) + "\n")
    return path


def read_entry(file: Path) -> Entry:
    """The entry in a file; InputError if the file is not an entry."""
    try:
        content = json.loads(read_text(file))
        columns = content.pop("rows")
        rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
        content |= {"arenas": tuple(content["arenas"]), "seeds": tuple(content["seeds"]), "rows": tuple(rows)}
        entry = Entry(**content)
        pairs = {(row["arena"], row["seed"]) for row in rows}
        if len(pairs) != len(rows) or len(rows) != len({a for a, _ in pairs}) * len(entry.seeds) or not rows:
            raise ValueError("it must have exactly one row for each arena and seed")
        entry.values("exploration.t99_s", np.inf)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        said = f"the key {error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())
        raise InputError(f"{file}: not a valid leaderboard entry ({said}); delete it and repeat its sweep") from error
    return entry


class Board(NamedTuple):
    """A table of comparable entries: its title, its column headings, and a row of texts for each entry."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def boards(entries: Iterable[Entry]) -> Iterator[Board]:
    """A table for each set of arenas and seeds; the method that explores 99% soonest comes first."""
    groups: dict[Any, list[Entry]] = defaultdict(list)
    for entry in entries:
        groups[entry.comparison_key].append(entry)
    for (arenas, seeds, _), group in sorted(groups.items()):
        columns = {head: column(group) for head, column in TABLE_COLUMNS.items()}
        estimates = {head: [estimate(v) for v in values] for head, values in columns.items() if values}
        order = np.argsort([found.value for found in estimates[SORT_COLUMN]], kind="stable")
        count = len(group[0].rows) // len(seeds)
        rows = [
            (
                e.method,
                *(estimate_text(estimates[h][n]) for h in estimates),
                str(_failed(e)),
                f"{e.commit}, {e.processor}",
            )
            for n, e in ((n, group[n]) for n in order)
        ]
        named = arenas if len(arenas) <= 3 else (arenas[0], "…", arenas[-1])
        size = f"{count} {'arena' if count == 1 else 'arenas'}"
        repeats = f"{'seed' if len(seeds) == 1 else 'seeds'} {' '.join(map(str, seeds))}"
        title = f"{' '.join(named)}: {size}, {repeats}"
        yield Board(title, ("method", *estimates, "failed", "commit, processor"), tuple(rows))


def estimate_text(found: Estimate) -> str:
    """An estimate with its interval, if it has one, as text; – for values that are not finite."""
    value, low, high = (figure_text(value) if np.isfinite(value) else "–" for value in found)
    return value if value == "–" or low == high else f"{value} ({low}–{high})"


def _failed(entry: Entry) -> int:
    return sum(row.get("failed") is not None for row in entry.rows)


def _time_column(key: str) -> Callable[[Sequence[Entry]], list[Values]]:
    return lambda group: [entry.values(key, np.inf) for entry in group]


def _optional_column(key: str, missing: float = np.inf) -> Callable[[Sequence[Entry]], list[Values]]:
    """A function that returns each entry's values of a figure, or an empty list if no episode has the figure.

    ``missing``: value for an episode that lacks the figure.
    """

    def shown(group: Sequence[Entry]) -> list[Values]:
        found = [entry.values(key, missing) for entry in group]
        return found if np.not_equal(found, missing).any() else []

    return shown


def _t99_ratios(group: Sequence[Entry]) -> list[Values]:
    """(arenas, seeds) times to explore 99% divided by the times of ``REFERENCE``; 1 if neither explored 99%."""
    times = {entry.method: entry.values("exploration.t99_s", np.inf) for entry in group}
    if REFERENCE not in times:
        return []
    with np.errstate(invalid="ignore"):
        return [np.nan_to_num(times[e.method] / times[REFERENCE], nan=1.0, posinf=np.inf) for e in group]


def _mean_explored(axis: str) -> Callable[[Sequence[Entry]], list[Values]]:
    """A function that returns each entry's (arenas, seeds) explored fractions, averaged over time or distance.

    The average ends where the longest episode in the arena ends. ``axis``: a key of :data:`END_KEYS`.
    """

    def means(group: Sequence[Entry]) -> list[Values]:
        ends = [entry.values(END_KEYS[axis], 0.0) for entry in group]
        horizon = np.maximum(np.max([end.max(axis=1) for end in ends], axis=0), 1e-9)[:, None]
        named = [{key: e.values(f"exploration.{key}", value) for key, value in NOTHING_SEEN.items()} for e in group]
        return [np.asarray(mean_up_to(horizon, end, found, axis)) for end, found in zip(ends, named, strict=True)]

    return means


def _mean_speed(group: Sequence[Entry]) -> list[Values]:
    """Mean speeds, m/s: 0 for failed episodes, inf for entries without this figure; empty if no entry has it."""
    found = [entry.values("navigation.mean_speed", np.nan) for entry in group]
    if not np.isfinite(found).any():
        return []
    return [np.nan_to_num(speeds) if np.isfinite(speeds).any() else np.full_like(speeds, np.inf) for speeds in found]


def _turning_fractions(group: Sequence[Entry]) -> list[Values]:
    """Fractions of the time spent turning in place, inf for episodes without this figure; empty if all lack it."""
    found = [e.values("navigation.time_s.turning", np.inf) / e.values("sim_time_s", 1.0) for e in group]
    return found if np.isfinite(found).any() else []


def _people_found(group: Sequence[Entry]) -> list[Values]:
    """Fractions of people found, 0 for failed episodes, in the arenas that contain any."""
    present = np.max([entry.values("victims.present", 0.0) for entry in group], axis=0)
    # If all episodes with a seed failed, those with other seeds tell how many people the arena contains.
    present = np.where(present > 0, present, present.max(axis=1, keepdims=True))
    has_any = present.any(axis=1)
    return [e.values("victims.found", 0.0)[has_any] / present[has_any] for e in group] if has_any.any() else []


SORT_COLUMN = "T_99, s"
"""Heading of the column by which a table is sorted."""
TABLE_COLUMNS: dict[str, Callable[[Sequence[Entry]], list[Values]]] = {
    "T_90, s": _time_column("exploration.t90_s"),
    SORT_COLUMN: _time_column("exploration.t99_s"),
    f"T_99 over {REFERENCE}": _t99_ratios,
    "explored, mean over time": _mean_explored("time"),
    "explored, mean over path": _mean_explored("way"),
    "path over oracle": _optional_column("exploration.path_over_oracle"),
    "time over oracle": _optional_column("exploration.time_over_oracle"),
    "time over physical": _optional_column("exploration.time_over_physical"),
    "mean speed, m/s": _mean_speed,
    "turning in place": _turning_fractions,
    "map F1, 5 cm": _optional_column("semantic_map.f1_5cm", 0.0),
    "map F1, 10 cm": _optional_column("semantic_map.f1_10cm", 0.0),
    "people found": _people_found,
}
"""For each column of a table, a function that returns each entry's values, or an empty list to omit the column."""
