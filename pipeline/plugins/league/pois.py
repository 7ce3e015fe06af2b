"""Points of interest: the finds in the league's list format (``pois.csv``, version 1.3)."""

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from pipeline.arrays import Place, Pose
from pipeline.files import atomic_write, read_text
from pipeline.plugins.league.brief import DEFAULT_START, MissionBrief
from pipeline.plugins.league.rules import LENGTHS
from pipeline.tracks.find import Find
from pipeline.transforms import inverse, transform_points

POI_TYPES = ("ar_code", "hazmat_sign", "real_object", "heat_sig")
TYPE_OF = {
    "april_tag": "ar_code",
    "hazmat_sign": "hazmat_sign",
    "heat": "heat_sig",
    **dict.fromkeys(("victim", "fire_extinguisher", "door_lever"), "real_object"),
}
"""The league's type for each kind of find; QR codes have no type. It is an assumption that victims are objects."""
POI_COLUMNS = "detection,time,type,name,x,y,z,robot,mode"
MODES = {"A": "autonomous", "T": "teleoperated"}
HEADER = ("pois", "1.3", "team", "country", "date", "time", "mission")
"""The quoted lines above the columns: two fixed words, then five values of the mission."""

FORMATS = {"date": "%Y-%m-%d", "time": "%H:%M:%S"}

_TEXT, _NUMBER = r'"((?:[^"]|"")*)"', r"(-?\d+(?:\.\d+)?)"
_ROW = re.compile(rf"(\d+),(\d\d:\d\d:\d\d),{_TEXT},{_TEXT},{_NUMBER},{_NUMBER},{_NUMBER},{_TEXT},(\w*)")


@dataclass(frozen=True, eq=False)
class PointOfInterest:
    """A find as the league lists it.

    Attributes:
        time: time of the detection, ``HH:MM:SS``.
        type: one of ``POI_TYPES``.
        name: number of a tag, class of a sign, or kind of an object.
        position: position in the frame of the 3D map, m.
        robot: name of the robot that made the find.
        mode: a key of ``MODES``.
    """

    time: str
    type: str
    name: str
    position: Place
    robot: str = "robot1"
    mode: str = "A"


@dataclass
class PoiFile:
    """The content of a list of points of interest, and the errors in it.

    Attributes:
        header: values of the header lines, by the names in ``HEADER``.
        pois: the rows without errors.
        errors: the errors, one line each.
    """

    header: dict[str, str] = field(default_factory=dict)
    pois: list[PointOfInterest] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


def points_of_interest(
    finds: Iterable[Find], T_map_league: Pose, start: datetime, begin: float = 0.0
) -> list[PointOfInterest]:
    """The finds that the league lists, in order of time; of each object, only the most confident find is kept.

    Args:
        finds: all finds, confirmed people included.
        T_map_league: pose of the frame of the 3D map.
        start: start of the mission, which is also the time of finds from an earlier run.
        begin: time of the start on the robot's clock, s.
    """
    kept: list[tuple[datetime, PointOfInterest]] = []
    for find in sorted(finds, key=lambda find: -find.confidence):
        if find.kind in TYPE_OF:
            place = transform_points(inverse(T_map_league), find.position[None])[0].astype(float)
            time = start + timedelta(seconds=int(np.nan_to_num(find.time_s - begin)))
            poi = PointOfInterest(
                f"{time:%H:%M:%S}", TYPE_OF[find.kind], name_of(find.kind, find.text), place.round(2)
            )  # rounded as in the file
            kept += [] if any(is_same_object(poi, other) for _, other in kept) else [(time, poi)]
    return [poi for _, poi in sorted(kept, key=lambda found: (found[0], found[1].type, found[1].name))]


def name_of(kind: str, text: str) -> str:
    """The name of a find in the list: its class or number on one line or, if it has none, its kind."""
    return " ".join(text.split()) or kind


def is_same_object(a: PointOfInterest, b: PointOfInterest) -> bool:
    """Whether two finds are one object: same type and name, and too close to be two objects side by side."""
    return (a.type, a.name) == (b.type, b.name) and bool(np.linalg.norm(a.position - b.position) < LENGTHS["diamond"])


def write_pois(path: Path, brief: MissionBrief, pois: Sequence[PointOfInterest]) -> None:
    """Write the list; InputError if it cannot be written."""
    start = brief.start
    own = (brief.team, brief.country, f"{start:%Y-%m-%d}", f"{start:%H:%M:%S}", brief.name)
    rows = [
        f"{number},{poi.time},{_quoted(poi.type)},{_quoted(poi.name)},"
        f"{','.join(f'{x:.2f}' for x in poi.position)},{_quoted(poi.robot)},{poi.mode}"
        for number, poi in enumerate(pois, 1)
    ]
    with atomic_write(path) as partial:
        partial.write_text("\n".join([*map(_quoted, (*HEADER[:2], *own)), POI_COLUMNS, *rows, ""]), encoding="utf-8")


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def read_pois(path: Path) -> PoiFile:
    """Read a list, from sarsim or any other program, and note the errors for which a judge would reject it.

    Raises:
        InputError: the file is not a regular text file, or cannot be read.
    """
    read, lines = PoiFile(), read_text(path).splitlines()
    for number, (name, line) in enumerate(zip(HEADER, lines, strict=False), 1):
        _read_header(read, number, name, line)
    if len(lines) <= len(HEADER):
        read.errors.append(
            f"must have {len(HEADER)} header lines and a line of column names; lines in the file: {len(lines)}"
        )
        return read
    if lines[len(HEADER)] != POI_COLUMNS:
        read.errors.append(f"line {len(HEADER) + 1}: must be {POI_COLUMNS}")
    for number, line in enumerate(lines[len(HEADER) + 1 :], 1):
        _read_row(read, number, len(HEADER) + 1 + number, line)
    return read


def _read_header(read: PoiFile, number: int, name: str, line: str) -> None:
    """Read one line of the header."""
    if not re.fullmatch(_TEXT, line):
        wanted = f'"{name}"' if number <= 2 else f"the {name} in double quotes"
        read.errors.append(f"line {number}: must be {wanted}")
        return
    (value,) = next(csv.reader([line]))
    read.header[name] = value
    if number <= 2 and value != name:
        read.errors.append(f'line {number}: must be "{name}"')
    elif not value.strip():
        read.errors.append(f"line {number}: the {name} is empty")
    elif name in FORMATS and not _has_format(value, FORMATS[name]):
        read.errors.append(
            f"line {number}: must be a valid {name} such as {DEFAULT_START:{FORMATS[name]}}, not {value!r}"
        )


def _has_format(text: str, form: str) -> bool:
    """Whether a text is a date or time in a given format, with all its zeros."""
    try:
        return f"{datetime.strptime(text, form):{form}}" == text
    except ValueError:
        return False


def _read_row(read: PoiFile, number: int, at: int, line: str) -> None:
    """Read the ``number``-th detection, which is in line ``at``."""
    row = _ROW.fullmatch(line)
    if row is None:
        read.errors.append(f"line {at}: must be {POI_COLUMNS}, with type, name and robot in double quotes")
        return
    label, time, kind, name, x, y, z, robot, mode = (text.replace('""', '"') for text in row.groups())
    poi = PointOfInterest(time, kind, name, np.array([float(x), float(y), float(z)]), robot, mode)
    wrong = {
        f"detection = {label}: must be {number}, because rows are numbered in order": int(label) != number,
        f"time = {time}: must be a valid time such as {DEFAULT_START:{FORMATS['time']}}": not _has_format(
            time, FORMATS["time"]
        ),
        f"type = {kind!r}: must be one of {', '.join(POI_TYPES)}": kind not in POI_TYPES,
        f"name = {name!r}: must not be empty": not name.strip(),
        f"mode = {mode!r}: must be {' or '.join(f'{key} ({text})' for key, text in MODES.items())}": mode
        not in MODES,
    }
    same = next((k for k, other in enumerate(read.pois, 1) if is_same_object(poi, other)), None)
    if same is not None:
        near = f"with the same type and name less than {LENGTHS['diamond']:g} m away"
        wrong[f"{kind} {name!r}: repeats an earlier row {near}; list each object once"] = True
    read.errors += [f"line {at}: {text}" for text, is_wrong in wrong.items() if is_wrong]
    if not any(wrong.values()):
        read.pois.append(poi)
