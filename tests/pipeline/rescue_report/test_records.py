"""People and finds as data, read back as other programs would, and on the page: text is never markup."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.rescue_report.page import page
from pipeline.rescue_report.records import COLUMNS, finds_data, people_data, write_finds, write_people
from pipeline.rescue_report.situation import Situation
from pipeline.tracks.find import Find
from tests.pipeline.rescue_report.html_page import read
from tests.pipeline.rescue_report.people import before_a_wall, block, victim, victims

ROOT = Path(__file__).parents[3]
ALICE = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
BOB = victim(block((9.0, 0.0, 0.2), (1.7, 0.5, 0.3)), cameras=1)
PHOTO = np.full((30, 40, 3), (10, 200, 30), np.uint8)
SCRIPT = "<script>alert('1')</script>\x07" + "long" * 1000


def find(kind: str, text: str, time: float = 2.5) -> Find:
    return Find(kind, text, np.array([1.5, 0.2, 0.7]), np.eye(3) * 1e-3, time, 0.9, PHOTO)


@pytest.fixture(scope="module")
def situation() -> Situation:
    return replace(
        before_a_wall(victims(ALICE, BOB)),
        finds=[find("hazmat_sign", "poison"), find("qr_code", SCRIPT, float("nan"))],
    )


def test_finds_come_back_as_json_with_the_confirmed_people(situation: Situation, tmp_path: Path) -> None:
    write_finds(tmp_path, situation)
    person, sign, code = json.loads((tmp_path / "finds.json").read_text())
    assert list(sign) == ["kind", "text", "position", "covariance", "time_s", "confidence", "photo"]
    assert (person["kind"], person["text"], person["photo"]) == ("victim", "", "victim_1.jpg")
    assert (sign["kind"], sign["text"], sign["time_s"]) == ("hazmat_sign", "poison", 2.5)
    assert sign["position"] == [1.5, 0.2, 0.7] and np.shape(sign["covariance"]) == (3, 3)
    assert code["text"] == SCRIPT and code["time_s"] is None
    assert (tmp_path / sign["photo"]).stat().st_size > 0 and not (tmp_path / "victim_1.jpg").exists()


def test_a_person_was_found_when_this_run_first_saw_the_person() -> None:
    person = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)), 3)
    person.seen = [replace(seen, time=time) for seen, time in zip(person.seen, (np.nan, 7.0, 5.0), strict=True)]
    found = person.to_find()
    assert (found.kind, found.text, found.time_s) == ("victim", "", 5.0)


def test_the_heat_of_a_person_is_told_on_the_persons_card_alone(situation: Situation) -> None:
    alice, bob = situation.people[0], situation.unconfirmed_people[0]
    lamp, warmth = (
        find("heat", "lamp"),
        replace(find("heat", ""), position=alice.victim.position, is_heat_of_person=True),
    )
    warm = replace(situation, people=[replace(alice, is_warm=True)], finds=[lamp, warmth])
    root = read(page(warm, {"arena": "nist_6x4"}))
    (table,) = root.all("table", "finds")
    assert "1 other find" in root.text and len(list(table.all("tr"))) == 2 and "lamp" in table.text
    assert ["warm" in card.text for card in root.all("article")] == [True, bob.is_warm]
    assert [find["kind"] for find in finds_data(warm)] == ["victim", "heat", "heat"]


def test_what_a_code_says_is_never_markup_and_cut(situation: Situation) -> None:
    html = page(situation, {"arena": "nist_6x4"})
    root = read(html)
    assert "alert" not in "".join(script.text for script in root.all("script"))
    (table,) = root.all("table", "finds")
    _, sign, code = table.all("tr")
    assert "poison" in sign.text
    assert "<script>alert('1')</script>\ufffdlong" in code.text
    assert len(code.text) < 200
    assert "\x07" not in html


def test_every_find_is_on_the_map_and_in_the_legend(situation: Situation) -> None:
    root = read(page(situation, {"arena": "nist_6x4"}))
    (drawing,) = root.all("svg", "drawing")
    assert [mark.text for mark in drawing.all("text", "find-mark")] == ["1", "2"]
    assert "other find" in next(root.all("ul", "legend")).text
    nothing = replace(situation, finds=[])
    assert "other find" not in page(nothing, {"arena": "nist_6x4"})
    assert len(finds_data(nothing)) == 1


def test_people_come_back_as_json(situation: Situation, tmp_path: Path) -> None:
    write_people(tmp_path, situation)
    data = json.loads((tmp_path / "victims.json").read_text())
    assert data["frame"] == "map" and data["searched"]
    alice, bob = data["people"]
    assert (alice["id"], alice["confirmed"], bob["confirmed"]) == ("1", True, False)
    np.testing.assert_allclose(alice["position"], [1.6, 0.3, 0.2], atol=0.01)
    np.testing.assert_allclose(alice["covariance"], 0.01 * np.eye(3), atol=1e-6)
    assert bob["posture"] == "lying" and bob["keyframes"] == 1
    assert bob["way"]["gap"] > 5 and not bob["way"]["arrives"]
    assert len(alice["way"]["points"]) >= 2
    photo = cv2.imread(str(tmp_path / alice["photo"]))
    assert photo.shape == ALICE.photo.shape


def test_two_boxes_in_one_image_are_one_keyframe() -> None:
    person = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)), 3)
    first, second, third = person.seen
    person.seen = [replace(first, time=1.0), replace(second, time=2.0), replace(third, keyframe=1, time=2.0)]
    (row,) = people_data(before_a_wall(victims(person)))["people"]
    assert row["keyframes"] == len(row["times"]) == 2


def test_people_come_back_as_a_table(situation: Situation, tmp_path: Path) -> None:
    write_people(tmp_path, situation)
    with (tmp_path / "victims.csv").open(newline="") as file:
        alice, bob = csv.DictReader(file)
    assert tuple(alice) == COLUMNS
    assert float(alice["x_m"]) == pytest.approx(1.6, abs=0.01)
    assert [float(alice[key]) for key in ("xx_m2", "xy_m2", "zz_m2")] == pytest.approx([0.01, 0, 0.01])
    assert (bob["confirmed"], bob["arrives"], bob["deepest_m"]) == ("False", "False", "")
    assert (tmp_path / bob["photo"]).exists()


def test_every_field_is_described(situation: Situation) -> None:
    data = people_data(situation)
    said = set(re.findall(r"`([\w.]+)`", (ROOT / "docs" / "rescue-report.md").read_text()))
    way = {f"way.{key}" for key in data["people"][0]["way"]}
    assert {*data, *data["people"][0], *way, *COLUMNS} <= said
