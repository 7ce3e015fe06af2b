"""Tables of episodes as Parquet files."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.files import atomic_write
from sarsim.commands.sweeps.episodes import Row

KEYS = ("method", "arena", "seed", "checksum", "failed")


def write_parquet(rows: Sequence[Row], path: Path) -> None:
    """Write a row for each episode, and a column for each key in any of them, empty where an episode lacks it.

    Raises:
        InputError: the file cannot be written.
    """
    known = {key for row in rows for key in row}
    keys = [*KEYS, *sorted(known.difference(KEYS))]
    table = pa.table({key: _column([row.get(key) for row in rows]) for key in keys})
    with atomic_write(path) as part:
        pq.write_table(table, part)


def _column(values: Sequence[object]) -> pa.Array:
    """A column; integers among floats become floats, so that a key's type does not depend on the episodes."""
    if any(isinstance(value, float) for value in values):
        values = [float(value) if isinstance(value, int) else value for value in values]
    return pa.array(values)
