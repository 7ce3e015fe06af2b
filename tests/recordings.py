"""Reading Rerun recordings back."""

from collections import defaultdict
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

Row = dict[str, Any]

ROW_ID = "rerun.controls.RowId"


def read(path: Path) -> dict[str, list[Row]]:
    """All rows of a recording, by entity and in the order of time.

    A row has the timelines that it is on and a list for every component that was logged with it.
    """
    rows: dict[str, dict[bytes, Row]] = defaultdict(lambda: defaultdict(dict))
    for chunk in RrdReader(path).stream():
        # Rerun may store components of one row in different chunks.
        for columns in chunk.to_record_batch().to_pylist():
            known = {name: value for name, value in columns.items() if value is not None}
            rows[chunk.entity_path][known.pop(ROW_ID)] |= known
    return {entity: _in_order(list(found.values())) for entity, found in rows.items()}


def _in_order(rows: list[Row]) -> list[Row]:
    for row in rows:
        if "sim_time" in row:
            row["sim_time"] = row["sim_time"].total_seconds()
    return sorted(rows, key=lambda row: row.get("sim_time", -1.0))
