"""The benchmark of finds: figures of episodes, and of photos by hand."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.tracks.find import Reading, box_corners
from pipeline.victims.detection.detection import Detection
from scripts.benchmarks.finds import figures_of
from scripts.benchmarks.finds_photos import PhotoScore, photo_figures

BOX = box_corners((0, 0, 20, 20))


def reading(kind: str, text: str, confidence: float = 1.0) -> Reading:
    return Reading(kind, text, BOX, confidence)


def test_the_boards_signs_are_counted_as_multisets():
    score = PhotoScore()
    board = {"hazmat": ["poison", "poison", "oxygen"], "qr": 1}
    signs = [reading("hazmat_sign", text) for text in ("poison", "oxygen", "oxygen", "explosive")]
    score.add_board([*signs, reading("hazmat_sign", "poison", 0.4), reading("qr_code", "a")], board, "50")
    score.add_board([reading("hazmat_sign", "poison"), reading("qr_code", "")], board, "150")
    assert score.figures() == {
        "real.hazmat_found.50cm": 1.0,  # four reported, of three
        "real.hazmat_right": (2 + 1) / (3 + 1),
        "real.qr_read.50cm": 1.0,
        "real.hazmat_found.150cm": 1 / 3,
        "real.qr_read.150cm": 0.0,
    }


def test_only_clear_and_large_people_are_to_be_found():
    score = PhotoScore()
    reference = [(0, 0, 50, 100, 0.9), (200, 0, 50, 100, 0.5), (300, 0, 50, 59, 0.9), (400, 0, 100, 100, 0.6)]
    found = [Detection((0, 0, 50, 90), 0.6), Detection((400, 0, 500, 100), 0.3)]
    score.add_people(found, reference, 400)
    assert score.figures() == {"real.people_found_50": 0.5, "real.people_found_25": 1.0}


def test_an_alarm_is_a_photo_with_any_box():
    score = PhotoScore()
    for people in ([], [Detection((0, 0, 9, 9), 0.3)] * 2, [Detection((0, 0, 9, 9), 0.5)], []):
        score.add_empty(people)
    assert score.figures() == {"real.empty_alarms_50": 0.25, "real.empty_alarms_25": 0.5}


class Blind:
    def detect(self, rgb: np.ndarray) -> list[Detection]:
        return []

    def read_image(self, rgb: np.ndarray, detections: list[Detection]) -> list[Reading]:
        return [reading("hazmat_sign", "poison")] if rgb.mean() > 100 else []


def test_a_folder_of_photos_is_read_by_its_truth(tmp_path: Path):
    for name, grey in (("arena/board01_50cm", 200), ("arena/wall", 200), ("people/a", 0), ("rooms/b", 200)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / f"{name}.jpg"), np.full((40, 60, 3), grey, np.uint8))
    with pytest.raises(InputError, match=r"truth\.json"):
        photo_figures(tmp_path, Blind(), Blind())
    people = {"a.jpg": {"coco_person": [[0, 0, 30, 30, 0.9]]}}
    (tmp_path / "truth.json").write_text(
        json.dumps({"boards": {"01": {"hazmat": ["poison"], "qr": 0}}, "people": people})
    )
    figures = photo_figures(tmp_path, Blind(), Blind())
    assert figures["real.images"] == 4 and figures["real.empty_alarms_25"] == 0
    assert figures["real.people_found_50"] == 0
    assert figures["real.hazmat_found.50cm"] == figures["real.hazmat_right"] == 1
    assert figures["real.hazmat_false"] == 0.5
    assert "real.qr_read.50cm" not in figures


def test_shares_of_episodes_are_over_all_things():
    kind = {"present": 3, "visible": 2, "found": 2, "visible_found": 1, "read": 1, "false_alarms": 1}
    victims = {"visible": 1, "found": 1, "visible_found": 1, "false_alarms": 0}
    result = {
        "report": {"victims": victims, "finds": {"hazmat_sign": kind}},
        "position_errors": [0.1],
        "find_errors": {"hazmat_sign": [0.1, 0.3]},
    }
    figures = figures_of([result, result])
    assert figures["hazmat_sign.found"] == figures["hazmat_sign.read"] == 0.5
    assert figures["hazmat_sign.false_alarms"] == 1
    assert figures["hazmat_sign.position_error_m.median"] == pytest.approx(0.2)
    assert figures["victim.found"] == 1 and figures["victim.position_error_m.median"] == 0.1
    assert "qr_code.found" not in figures
