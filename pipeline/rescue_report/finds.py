"""All finds of a situation as data for other programs: finds.json, and a photo of each."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.files import atomic_write
from pipeline.frame import jpeg
from pipeline.rescue_report.people import Row, photo_name, plain
from pipeline.rescue_report.situation import Situation
from pipeline.tracks.find import Find


def finds_data(situation: Situation) -> list[Row]:
    """The content of finds.json, confirmed people included: lengths in m, times in s, positions in ``map``.

    Text is as it was read; JSON escapes all characters that are not printable ASCII.
    """
    return [_row(find, photo) for find, photo in _named(situation)]


def _row(find: Find, photo: str) -> Row:
    return {
        "kind": find.kind,
        "text": find.text,
        "position": plain(find.position),
        "covariance": plain(find.covariance),
        "time_s": plain(find.time_s) if np.isfinite(find.time_s) else 0.0,  # NaN: found in an earlier run
        "confidence": round(find.confidence, 4),
        "photo": photo,
    }


def _named(situation: Situation) -> Iterator[tuple[Find, str]]:
    """Each find with the file name of its photo."""
    yield from ((person.victim.find(), photo_name(person)) for person in situation.people)
    yield from ((find, f"find_{k}.jpg") for k, find in enumerate(situation.finds, start=1))


def write_finds(folder: Path, situation: Situation) -> None:
    """Write finds.json and the photos of all finds except people; InputError if a file cannot be written."""
    with atomic_write(folder / "finds.json") as path:
        path.write_text(json.dumps(finds_data(situation), indent=1, allow_nan=False) + "\n")
    for find, name in _named(situation):
        if find.kind != "victim":
            with atomic_write(folder / name) as path:
                path.write_bytes(jpeg(find.photo))
