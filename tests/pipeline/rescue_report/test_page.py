"""The page, read back as a browser would."""

import json
import re
from base64 import b64decode
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.exploration.viewpoint import Viewpoint
from pipeline.rescue_report.ground import ReportedPlace
from pipeline.rescue_report.page import page
from pipeline.rescue_report.records import people_data
from pipeline.rescue_report.situation import Trust
from tests.pipeline.rescue_report.html_page import Tag, read
from tests.pipeline.rescue_report.people import before_a_wall, block, victim, victims

ALICE = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
BOB = victim(block((9.0, 0.0, 0.2), (1.7, 0.5, 0.3)), cameras=1)
REPORT = {
    "arena": "nist",
    "seed": 3,
    "sim_time_s": 12.25,
    "config": {"steps": 160, "out": None},
    "exploration": {"explored_fraction": 0.4321},
}


@pytest.fixture(scope="module")
def html() -> str:
    return page(before_a_wall(victims(ALICE, BOB), end_reason="interrupted"), REPORT)


@pytest.fixture(scope="module")
def root(html: str) -> Tag:
    return read(html)


def texts(root: Tag, name: str, kind: str = "") -> list[str]:
    return [tag.text for tag in root.all(name, kind)]


def test_the_page_needs_nothing_else(html: str, root: Tag) -> None:
    text = re.sub(r'"data:image/\w+;base64,[^"]*"', "", html)
    assert not re.search(r"data:|https?:|//|@import|<script(?! type=.application/json)|<link|\bon\w+=", text)
    assert set(re.findall(r"url\(([^)]*)\)", html)) <= {"#hatched", "#taped"}
    tags = [tag for name in ("img", "image", "a", "iframe") for tag in root.all(name)]
    assert tags
    for tag in tags:
        assert all(
            tag.attributes.get(key, "data:").startswith("data:image/") or key not in tag.attributes
            for key in ("src", "href")
        )


def test_everything_that_is_shown_is_said_too(root: Tag) -> None:
    assert all(tag.attributes["alt"] for tag in root.all("img"))
    (drawing,) = root.all("svg", "drawing")
    assert drawing.attributes["role"] == "img"
    assert next(drawing.all("title")).text.startswith("Map from above: 1 person")
    identifiers = re.findall(r' id="([^"]+)"', str(root))
    assert len(identifiers) == len(set(identifiers))
    (document,) = root.all("html")
    assert document.attributes["lang"] == "en"


def test_a_card_says_where_a_person_is(root: Tag) -> None:
    alice, bob = root.all("article")
    assert alice.attributes["class"] == "card"
    assert "x 1.60, y 0.30, z 0.20 m" in alice.text
    # √5.991 deviations of 0.1 m hold 95% of the plane.
    assert "within 0.2 m (σ 0.10 / 0.10 / 0.10 m)" in alice.text
    assert "1.6 m from the entrance" in alice.text
    assert "0.3 × 0.3 × 0.4 m" in alice.text
    assert "90% confidence, in 2 keyframes, up to 1.0 m apart" in alice.text
    assert "unconfirmed" in bob.attributes["class"]
    assert "Posturelying, " in bob.text
    assert "cannot reach the person" in bob.text


def test_a_card_counts_the_keyframes_that_missed_the_person() -> None:
    missed = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
    missed.missed = {7, 9}
    assert "not found in 2 keyframes" in read(page(before_a_wall(victims(missed)), REPORT)).text


def test_the_page_holds_the_people_as_data(root: Tag) -> None:
    (data,) = root.all("script")
    assert json.loads(data.text) == people_data(before_a_wall(victims(ALICE, BOB), end_reason="interrupted"))


def test_the_photo_is_the_robots(root: Tag) -> None:
    source = next(next(root.all("article")).all("img")).attributes["src"]
    data = np.frombuffer(b64decode(source.removeprefix("data:image/jpeg;base64,")), np.uint8)
    photo = cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1]
    assert photo.shape == ALICE.photo.shape
    np.testing.assert_allclose(photo, ALICE.photo, atol=4)


def test_scores_stand_apart_from_what_the_robot_knew(root: Tag) -> None:
    (truth,) = root.all("div", "truth")
    assert "exploration\nexplored_fraction0.4321" in truth.text
    assert "ground truth" in truth.text
    assert "43" not in "".join(texts(root, "div", "tile"))
    assert "config" not in truth.text
    rows = [row.text for row in root.all("tr")]
    assert "sim_time_s12.25" in rows
    assert texts(root, "p", "run") == ["The robot took 1 keyframe in 12 s."]
    assert "outnot given" in rows


@pytest.mark.parametrize(
    ("trust", "is_good", "said"),
    [
        (Trust(0.002, 0.05), True, "and everything connected to it"),
        (Trust(0.05, 0.05), False, "the map contradicts itself"),
        (Trust(0.002, 0.8), False, "parts of the map may be misplaced"),
    ],
)
def test_green_is_earned_by_a_map_that_can_be_trusted(trust: Trust, is_good: bool, said: str) -> None:
    situation = before_a_wall(victims())
    seen = replace(situation.unseen, places=[])
    root = read(page(replace(situation, unseen=seen, trust=trust), {"arena": "a"}))
    tile = next(tile for tile in root.all("div", "tile") if "Explored" in tile.text)
    assert ("good" in tile.attributes["class"]) == is_good
    assert said in tile.text
    assert ("contradicts itself: 5%" in root.text) == (trust.contradicted == 0.05)
    assert ("1.6 m from where they are" in root.text) == (trust.deviation == 0.8)


WHOLE = replace(before_a_wall(victims()).unseen, places=[])
ADRIFT = replace(WHOLE, is_reachable=False)


@pytest.mark.parametrize(
    ("end_reason", "unseen", "signs", "said"),
    [
        ("nothing_left", WHOLE, "+++", "and everything connected to it"),
        ("not_worth_it", WHOLE, "+++", "and everything connected to it"),
        ("time", WHOLE, "!!!", "stopped early"),
        ("steps", WHOLE, "!!!", "stopped early"),
        (None, WHOLE, "!!!", "not searched for"),
        (None, ADRIFT, "!!!", "slopes and drops were not assessed"),
        ("nothing_left", ADRIFT, "!!!", "Unknown"),
    ],
)
def test_no_tick_is_given_that_the_robot_did_not_earn(end_reason, unseen, signs, said) -> None:
    situation = replace(before_a_wall(victims()), end_reason=end_reason, unseen=unseen)
    root = read(page(situation, {"arena": "a"}))
    tiles = list(root.all("div", "tile"))  # people, explored, ground
    assert "".join("+" if "good" in tile.attributes["class"] else "!" for tile in tiles) == signs
    assert said in root.text
    assert f"{unseen.seen_area:.0f} of {unseen.seen_area + unseen.area:.0f} m² " in root.text or unseen is ADRIFT


def test_an_own_arena_is_called_by_its_name(root: Tag) -> None:
    own = read(page(before_a_wall(None), {"arena": "/home/me/arenas/cellar.raf"}))
    assert texts(own, "h1") == ["cellar"]
    assert texts(read(page(before_a_wall(None), {"arena": "random:3"})), "h1") == ["random:3"]


def test_the_legend_names_what_is_on_the_map_alone(root: Tag) -> None:
    def legend(page: Tag) -> str:
        return "".join(texts(page, "ul", "legend"))

    assert "unconfirmed sighting" in legend(root) and "the robot's path to a person" in legend(root)
    nobody = legend(read(page(before_a_wall(victims()), {"arena": "a"})))
    assert "entrance" in nobody and "wall" in nobody
    assert not re.search("person;|sighting|path to|drop|slope", nobody)


def test_names_from_outside_are_text() -> None:
    evil = '<script>alert("1")</script> & <b>{{ title }}'
    html = page(before_a_wall(None), {"arena": evil, "config": {"<i>": "</td>"}})
    assert html.count("<script") == 1  # the people as data
    root = read(html)
    assert texts(root, "h1") == [evil]
    assert texts(root, "title")[0] == f"Rescue report: {evil}"
    assert list(root.all("i")) == []


def test_unseen_ground_takes_every_tick_but_the_grounds() -> None:
    situation = before_a_wall(victims())
    assert situation.has_finished and situation.unseen.places  # the camera sees no more than its 58°
    tiles = list(read(page(situation, {"arena": "a"})).all("div", "tile"))
    assert ["good" in tile.attributes["class"] for tile in tiles] == [False, False, True]
    assert re.search(r"\d places? not seen", tiles[1].text)


def test_the_page_lists_what_was_not_worth_the_drive() -> None:
    view = Viewpoint(np.array([1.0, 2.0]), 0.0, turn=True, gain=0.03, seconds=87.0)
    said = "0.03 m² from (1.0, 2.0) m, 1 min 27 s"
    assert said in page(replace(before_a_wall(None), viewpoints_left=[view]), {"arena": "a"})


def test_a_robot_without_a_detector_does_not_say_that_there_are_no_people() -> None:
    root = read(page(before_a_wall(None), {"arena": "a"}))
    assert "Not searched for" in texts(root, "div", "tile-answer")
    assert "found no person" not in root.text


def test_the_same_episode_gives_the_same_page(html: str) -> None:
    assert page(before_a_wall(victims(ALICE, BOB), end_reason="interrupted"), REPORT) == html


def test_the_worst_places_are_listed_and_the_others_counted() -> None:
    places = [ReportedPlace(np.array([1.0, -2.0]), 0.5, 0.1 * (20 - k)) for k in range(12)]
    situation = before_a_wall(None)
    hazards = replace(situation.hazards, slopes=places, drops=places[:1], ceilings=places[:1])
    text = read(page(replace(situation, hazards=hazards), {"arena": "a"})).text
    assert "115° at (1.0, −2.0) m, 0.5 m²" in text
    assert text.count(" at (1.0, −2.0) m, 0.5 m²") == 10
    assert "and 2 more" in text
    assert "200 cm deep at (1.0, −2.0) m" in text
    assert "Low ceilings: the lowest clearance is 2.0 m." in text


def test_a_robot_that_cannot_leave_the_entrance_says_so() -> None:
    situation = before_a_wall(victims(ALICE))
    without = [replace(person, route=None) for person in situation.people]
    stuck = replace(situation, people=without, unseen=WHOLE, can_leave=False)
    root = read(page(stuck, {"arena": "a"}))
    assert not [tile.text for tile in root.all("div", "tile") if "good" in tile.attributes["class"]]
    assert "no path leads out of the entrance" in "".join(texts(root, "span", "warning"))
    assert "The robot cannot reach person 1." in "".join(texts(root, "p", "summary"))
    assert list(root.all("ol")) == []
