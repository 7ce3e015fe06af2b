"""People and finds of a situation as data for other programs: victims.json, victims.csv, finds.json and photos."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.files import atomic_write
from pipeline.frame import jpeg
from pipeline.rescue_report.routes import Route
from pipeline.rescue_report.situation import Person, Situation

Row = dict[str, Any]
COLUMNS = (
    *("id", "confirmed", "x_m", "y_m", "z_m", "xx_m2", "xy_m2", "xz_m2", "yy_m2", "yz_m2", "zz_m2"),
    *("length_m", "width_m", "height_m", "posture", "confidence", "keyframes", "first_s", "last_s", "photo"),
    *("arrives", "way_m", "steepest_rad", "gap_m", "drops", "deepest_m"),
)
"""Columns of victims.csv; ``xx_m2`` to ``zz_m2`` are the upper triangle of the position's covariance."""


def people_data(situation: Situation) -> Row:
    """The content of victims.json: lengths in m, angles in rad, times in s, positions in ``map``."""
    people = [_person_row(person, person in situation.people) for person in situation.everyone]
    return {"version": 1, "frame": "map", "searched": situation.was_searched, "people": people}


def _person_row(person: Person, confirmed: bool) -> Row:
    victim = person.victim
    size = person.body_size
    return {
        "id": person.display_id,
        "confirmed": confirmed,
        "position": _plain(victim.position),
        "covariance": _plain(victim.covariance),
        "size": _plain([size.length, size.width, size.height]),
        "posture": size.posture or None,
        "confidence": round(victim.confidence, 4),
        "keyframes": len(victim.keyframes),
        "missed": len(victim.missed),
        "times": _plain(victim.times),
        "photo": _photo_name(person),
        "way": _route_row(person.route) if person.route else None,
    }


def _route_row(route: Route) -> Row:
    return {
        "arrives": route.arrives,
        "in_sight": route.is_in_sight,
        "gap": _plain(route.distance_to_person),
        "length": _plain(route.length),
        "steepest": _plain(route.steepest),
        "points": _plain(route.waypoints),
        "drops": [{"position": _plain(drop.position), "depth": _plain(drop.value)} for drop in route.drops],
    }


def _photo_name(person: Person) -> str:
    return f"victim_{person.display_id}.jpg"


def _plain(numbers: Any) -> Any:
    """A number, or an array as nested lists, rounded to six decimal places for JSON."""
    return np.round(np.asarray(numbers, np.float64), 6).tolist()


def _csv_row(person: Row) -> list[Any]:
    """A person's entry in :func:`people_data` as a row of victims.csv, where unknown values are empty."""
    upper = np.array(person["covariance"])[np.triu_indices(3)].tolist()
    seen = [person["posture"], person["confidence"], person["keyframes"]]
    first_last = person["times"][:1] + person["times"][-1:] or ["", ""]
    along: list[Any] = [""] * 6
    if way := person["way"]:
        depths = [drop["depth"] for drop in way["drops"]]
        along = [way["arrives"], way["length"], way["steepest"], way["gap"], len(depths), max(depths, default="")]
    where = [person["id"], person["confirmed"], *person["position"], *upper]
    return [*where, *person["size"], *seen, *first_last, person["photo"], *along]


def write_people(folder: Path, situation: Situation) -> None:
    """Write victims.json, victims.csv and people's photos; InputError if a file cannot be written."""
    data = people_data(situation)
    with atomic_write(folder / "victims.json") as path:
        path.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n")
    with atomic_write(folder / "victims.csv") as path, path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        table.writerows(_csv_row(person) for person in data["people"])
    for person in situation.everyone:
        with atomic_write(folder / _photo_name(person)) as path:
            path.write_bytes(jpeg(person.victim.photo))


def finds_data(situation: Situation) -> list[Row]:
    """The content of finds.json, confirmed people included: lengths in m, times in s, positions in ``map``.

    Text is as it was read; JSON escapes non-ASCII characters.
    """
    people = [(person.victim.to_find(), _photo_name(person)) for person in situation.people]
    others = [(find, f"find_{k}.jpg") for k, find in enumerate(situation.finds, start=1)]
    return [
        {
            "kind": find.kind,
            "text": find.text,
            "position": _plain(find.position),
            "covariance": _plain(find.covariance),
            "time_s": _plain(find.time_s) if np.isfinite(find.time_s) else None,  # NaN: found in an earlier run
            "confidence": round(find.confidence, 4),
            "photo": photo,
        }
        for find, photo in people + others
    ]


def write_finds(folder: Path, situation: Situation) -> None:
    """Write finds.json and the photos of all finds except people; InputError if a file cannot be written."""
    data = finds_data(situation)
    with atomic_write(folder / "finds.json") as path:
        path.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n")
    for find, row in zip(situation.finds, data[len(situation.people) :], strict=True):
        with atomic_write(folder / row["photo"]) as path:
            path.write_bytes(jpeg(find.photo))
