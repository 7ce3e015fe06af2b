"""People as data, read back as other programs would."""

import csv
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.rescue_report.people import COLUMNS, write_people
from pipeline.rescue_report.situation import Situation
from tests.pipeline.rescue_report.people import before_a_wall, block, victim, victims

ROOT = Path(__file__).parents[3]
ALICE = victim(block((1.6, 0.3, 0.2), (0.3, 0.3, 0.4)))
BOB = victim(block((9.0, 0.0, 0.2), (1.7, 0.5, 0.3)), cameras=1)


@pytest.fixture(scope="module")
def situation() -> Situation:
    return before_a_wall(victims(ALICE, BOB))


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


def test_people_come_back_as_a_table(situation: Situation, tmp_path: Path) -> None:
    write_people(tmp_path, situation)
    with (tmp_path / "victims.csv").open(newline="") as file:
        alice, bob = csv.DictReader(file)
    assert tuple(alice) == COLUMNS
    assert float(alice["x_m"]) == pytest.approx(1.6, abs=0.01)
    assert [float(alice[key]) for key in ("xx_m2", "xy_m2", "zz_m2")] == pytest.approx([0.01, 0, 0.01])
    assert (bob["confirmed"], bob["arrives"], bob["deepest_m"]) == ("False", "False", "")
    assert (tmp_path / bob["photo"]).exists()


def test_every_field_is_described(situation: Situation, tmp_path: Path) -> None:
    write_people(tmp_path, situation)
    data = json.loads((tmp_path / "victims.json").read_text())
    said = set(re.findall(r"`([\w.]+)`", (ROOT / "docs" / "rescue-report.md").read_text()))
    way = {f"way.{key}" for key in data["people"][0]["way"]}
    assert {*data, *data["people"][0], *way, *COLUMNS} <= said
