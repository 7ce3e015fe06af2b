"""The QR codes that a run has read, written with their positions to the file that the small league requires."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.arrays import Place, Pose
from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from pipeline.tracks.find import Find
from pipeline.transforms import inverse, transform_points

CODES_ENDING = "-codes.json"
"""Ending of the file name. The format is sarsim's own, because the rule book specifies no format for this file."""
QR_CODE = "qr_code"
EXAMPLE = '{"text": "A", "position": [1.0, 2.0, 0.5], "autonomous": true}'


@dataclass(frozen=True, eq=False)
class ReadCode:
    """A code that was read.

    Attributes:
        text: content of the code.
        position: position in the frame of the 3D map, m.
        is_autonomous: whether nobody was driving the robot.
    """

    text: str
    position: Place
    is_autonomous: bool = True


def codes_among(finds: Iterable[Find], T_map_league: Pose) -> list[ReadCode]:
    """For each text, the most confident QR code among finds.

    ``T_map_league``: pose of the league's frame, in which the codes' positions are given.
    """
    kept: dict[str, ReadCode] = {}
    for find in sorted(finds, key=lambda find: -find.confidence):
        if find.kind == QR_CODE and find.text not in kept:
            place = transform_points(inverse(T_map_league), find.position[None])[0].astype(float)
            kept[find.text] = ReadCode(find.text, place)
    return [kept[text] for text in sorted(kept)]


def write_codes(path: Path, codes: Iterable[ReadCode]) -> None:
    """Write codes to a file; InputError if it cannot be written."""
    rows = [
        {"text": code.text, "position": code.position.round(3).tolist(), "autonomous": code.is_autonomous}
        for code in codes
    ]
    with atomic_write(path) as partial:
        partial.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def read_codes(path: Path) -> list[ReadCode]:
    """Read codes written by sarsim or another program; InputError if the file cannot be read or is invalid."""
    try:
        return [_code(row) for row in _rows(json.loads(read_text(path)))]
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise InputError(
            f"{path}: must be a JSON list of QR codes with finite positions, each like {EXAMPLE}"
        ) from error


def _rows(read: object) -> list[dict[str, object]]:
    if not isinstance(read, list):
        raise ValueError
    return read


def _code(row: dict[str, object]) -> ReadCode:
    place = np.asarray(row["position"], np.float64)
    if place.shape != (3,) or not np.isfinite(place).all() or not isinstance(row["text"], str):
        raise ValueError
    return ReadCode(row["text"], place, row.get("autonomous", True) is True)
