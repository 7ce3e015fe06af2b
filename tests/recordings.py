"""Reading Rerun recordings back."""

from collections import defaultdict
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

Row = dict[str, Any]


def read(path: Path) -> dict[str, list[Row]]:
    """All rows of a recording, by entity and in the order of time.

    A row has the timelines that it is on and a list for every component that it carries.
    """
    rows: dict[str, list[Row]] = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for row in batch.drop_columns(["rerun.controls.RowId"]).to_pylist():
            if "sim_time" in row:
                row["sim_time"] = row["sim_time"].total_seconds()
            rows[chunk.entity_path].append(row)
    return {
        entity: sorted(found, key=lambda row: row.get("sim_time", -1.0)) for entity, found in rows.items()
    }
