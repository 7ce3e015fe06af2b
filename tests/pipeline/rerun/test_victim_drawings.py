"""Victims in the recording, read back from the file."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import rerun as rr

from pipeline.explorer import Explorer
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder, victim_drawings
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.victims.detection import Detection
from tests.pipeline.rescue_report.people import block, victim, victims
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot
from tests.recordings import read

rr.set_strict_mode(True)  # otherwise a call with wrong arguments is a warning alone

ON_THE_WALL = Detection((70.0, 30.0, 100.0, 50.0), 0.75)
ALICE = victim(block((1.6, 0.3, 0.2), (0.3, 0.4, 0.5)))
BOB = victim(block((0.5, 1.0, 0.2), (1.7, 0.5, 0.3)), cameras=1)
WHOLE = (720, 720, 3)
WAY = np.array([[0, 0, 0], [1, 0, 0], [1.3, 0.2, 0]])


class Mistaken:
    """A detector that takes a spot on the wall for a person."""

    def detect(self, rgb: np.ndarray) -> list[Detection]:
        return [ON_THE_WALL]


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """The rows of a recording of one step, in which two people are known."""
    path = tmp_path_factory.mktemp("wall-0") / "episode.rrd"
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier(), detector=Mistaken()))
    step = explorer.step()
    explorer.mapper.victims.all = [BOB, ALICE]
    recorder = Recorder(path)
    recorder.on_step(explorer.mapper, step)
    recorder.log_routes([WAY])
    recorder.close()
    return read(path)


def test_a_refused_box_says_why(rows):
    (row,) = rows["/world/robot/camera/victims"]
    assert row["Boxes2D:centers"] == [[85, 40]]
    assert row["Boxes2D:half_sizes"] == [[15, 10]]
    (label,) = row["Boxes2D:labels"]
    assert label.startswith("75%: flat")


def test_a_box_is_around_each_victim(rows):
    row = rows["/world/victims"][-1]
    assert row["Boxes3D:labels"] == ["person 1, 90%", "sighting A, 90%"]
    np.testing.assert_allclose(row["Boxes3D:centers"], [[1.6, 0.3, 0.2], [0.5, 1.0, 0.2]], atol=1e-5)
    around = np.array([[0.15, 0.2, 0.25], [0.85, 0.25, 0.15]]) + victim_drawings.BOX_MARGIN
    np.testing.assert_allclose(row["Boxes3D:half_sizes"], around, atol=1e-5)
    confirmed, unconfirmed = row["Boxes3D:colors"]
    assert confirmed != unconfirmed


def test_the_ellipsoid_holds_95_percent(rows):
    row = rows["/world/victims/certainty"][-1]
    np.testing.assert_allclose(row["Ellipsoids3D:half_sizes"], np.full((2, 3), 0.1 * np.sqrt(7.81473)), rtol=1e-5)


def test_ellipsoids_turn_as_their_covariance_does():
    person = victim(block((1, 0, 0), (0.3, 0.3, 0.3)))
    axis = np.array([1, 1, 0]) / np.sqrt(2)
    person.location = replace(person.location, covariance=0.01 * np.eye(3) + 0.08 * np.outer(axis, axis))
    drawn = victim_drawings.confidence_ellipsoids(victims(person))
    longest = np.array(drawn.half_sizes.as_arrow_array().to_pylist())[0]
    x, y, z, w = drawn.quaternions.as_arrow_array().to_pylist()[0]
    third = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]  # of the rotation's columns
    assert longest[2] == pytest.approx(np.sqrt(7.81473 * 0.09))
    assert abs(np.dot(third, axis)) == pytest.approx(1, abs=1e-6)


def test_photos_stand_beside_each_other(rows):
    data = np.array(rows["/world/victims/photos"][-1]["EncodedImage:blob"]).astype(np.uint8).ravel()
    sheet = cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1]
    assert sheet.shape == WHOLE
    width, height = WHOLE[1] // 2, WHOLE[0] // 2  # two in a row
    for middle in (width // 2, 3 * width // 2):
        np.testing.assert_allclose(sheet[height // 2, middle], ALICE.photo[0, 0], atol=12)


def test_ways_are_drawn_over_the_ground(rows):
    (strip,) = rows["/world/victims/ways"][-1]["LineStrips3D:strips"]
    np.testing.assert_allclose(np.array(strip)[:, :2], WAY[:, :2], atol=1e-6)


def test_no_victims_can_be_drawn():
    assert len(victim_drawings.boxes(victims()).centers) == 0
    assert len(victim_drawings.confidence_ellipsoids(victims()).centers) == 0
    (blob,) = victim_drawings.photo_sheet(victims(), 240).blob.as_arrow_array().to_pylist()
    empty = cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_COLOR)
    assert empty.shape == WHOLE  # as with victims
