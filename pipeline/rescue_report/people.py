"""The people of a situation as data for other programs: victims.json, victims.csv, and a photo of each."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.files import atomic_write
from pipeline.frame import jpeg
from pipeline.rescue_report.situation import Person, Situation

Row = dict[str, Any]
JSON, CSV = "victims.json", "victims.csv"


def people_data(situation: Situation) -> Row:
    """The content of victims.json: lengths in m, angles in rad, times in s, positions in ``map``."""
    people = [_person(person, person in situation.people) for person in situation.everyone]
    return {"version": 1, "frame": "map", "searched": situation.searched, "people": people}


def _person(person: Person, confirmed: bool) -> Row:
    victim, posture, route = person.victim, person.posture, person.route
    return {
        "id": person.display_id,
        "confirmed": confirmed,
        "position": plain(victim.position),
        "covariance": plain(victim.covariance),
        "size": plain([posture.length, posture.width, posture.height]),
        "posture": posture.name or None,
        "confidence": round(victim.confidence, 4),
        "keyframes": len(victim.cameras),
        "missed": victim.missed,
        "times": plain(victim.times),
        "photo": photo_name(person),
        "way": None
        if route is None
        else {
            "arrives": route.arrives,
            "in_sight": bool(route.in_sight),
            "gap": plain(route.gap),
            "length": plain(route.length),
            "steepest": plain(route.steepest),
            "points": plain(route.way),
            "drops": [{"position": plain(drop.position), "depth": plain(drop.value)} for drop in route.drops],
        },
    }


def photo_name(person: Person) -> str:
    """The file name of a person's photo, in the folder of the data."""
    return f"victim_{person.display_id}.jpg"


def plain(numbers: Any) -> Any:
    """A number, or an array (...) as nested lists, rounded to 1e-6 for JSON."""
    return np.round(np.asarray(numbers, np.float64), 6).tolist()


def write_people(folder: Path, situation: Situation) -> None:
    """Write the data and the photos into a folder; InputError if a file cannot be written."""
    data = people_data(situation)
    with atomic_write(folder / JSON) as path:
        path.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n")
    with atomic_write(folder / CSV) as path, path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(_row(person) for person in data["people"])
    for person in situation.everyone:
        with atomic_write(folder / photo_name(person)) as path:
            path.write_bytes(jpeg(person.victim.photo))


COLUMNS = (
    *("id", "confirmed", "x_m", "y_m", "z_m", "xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2"),
    *("length_m", "width_m", "height_m", "posture", "confidence", "keyframes", "first_s", "last_s", "photo"),
    *("arrives", "way_m", "steepest_rad", "gap_m", "drops", "deepest_m"),
)
"""Columns of victims.csv, with the upper triangle of the covariance, and the first and last of the times."""


def _row(person: Row) -> Row:
    """A person as a row of the table; unknown values are empty."""
    upper = np.array(person["covariance"])[np.triu_indices(3)].tolist()
    first_last = person["times"][:1] + person["times"][-1:] or ["", ""]
    way = person["way"]
    along: list[Any] = [""] * 6
    if way:
        depths = [drop["depth"] for drop in way["drops"]]
        along = [way["arrives"], way["length"], way["steepest"], way["gap"], len(depths), max(depths, default="")]
    rest = (person[key] for key in ("posture", "confidence", "keyframes"))
    head = (person["id"], person["confirmed"], *person["position"], *upper, *person["size"], *rest)
    return dict(zip(COLUMNS, (*head, *first_last, person["photo"], *along), strict=True))
