"""The victims' benchmark: the people who count, the figures of episodes, and the time of a frame."""

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.victims.detection.detector import VictimDetector
from sarsim.sensors.lighting import Lighting
from scripts.benchmarks import victims
from scripts.benchmarks.settings import VictimsSettings
from scripts.benchmarks.victims import speed
from scripts.benchmarks.victims_frames import PeopleInFrame, ap50, ap50_by, recipe, scene_frames
from tests.pipeline.victims.detection.networks import darknet_files

BOXES = np.array([(0, 0, 20, 20), (100, 0, 140, 20), (200, 0, 240, 40)], np.float64)


def people(found: list[int], area: int = 500) -> PeopleInFrame:
    """Three people, the second of whom is mostly hidden; some of them found."""
    return PeopleInFrame(
        boxes=BOXES,
        area=np.full(3, area),
        hidden=np.array([0.0, 0.7, 0.5]),
        distance=np.array([1.0, 2.0, 3.0]),
        found=BOXES[found],
        confidence=np.linspace(0.9, 0.6, len(found)),
    )


def test_a_person_mostly_hidden_need_not_be_found_and_does_not_count_if_found():
    assert ap50([people([0, 2])]) == ap50([people([0, 1, 2])]) == 1
    assert ap50([people([0])]) == 0.5
    assert np.isnan(ap50([people([0], area=399)]))


def test_precision_is_given_by_distance_and_by_what_is_hidden():
    frames = [people([0])]
    assert ap50_by(frames, "distance", (0, 1.5, 2.5, np.inf)) == {
        "0-1.5": {"ap50": 1.0, "people": 1},
        "2.5-inf": {"ap50": 0.0, "people": 1},
    }
    by_hidden = ap50_by(frames, "hidden", (0, 0.4, 0.6, 1.0))
    assert {name: row["people"] for name, row in by_hidden.items()} == {"0-0.4": 1, "0.4-0.6": 1, "0.6-1": 1}
    assert by_hidden["0.6-1"]["ap50"] == 0


class FindsNothing:
    def detect(self, rgb):
        return []


def test_the_same_people_are_seen_in_every_light():
    normal, dark = (
        list(scene_frames(recipe(2, 3), 2, light, FindsNothing())) for light in (Lighting.normal, Lighting.dark)
    )
    assert sum(len(people.boxes) for people in normal) > 0
    for a, b in zip(normal, dark, strict=True):
        np.testing.assert_array_equal(a.boxes, b.boxes)
        np.testing.assert_array_equal(a.hidden, b.hidden)
        assert ((a.hidden >= 0) & (a.hidden < 1)).all()
        assert (a.distance > 0.2).all()


def result(visible, found, alarms, errors, time):
    victims = {"present": 4, "found": found, "false_alarms": alarms, "visible": visible, "visible_found": found}
    victims["position_error_m"] = float(np.median(errors)) if errors else None
    report = {"victims": victims, "sim_time_s": time, "exploration": {"t90_s": time / 2}}
    return {"report": report, "position_errors": errors}


def test_shares_and_errors_are_of_all_victims_and_times_of_pairs():
    found = [result(3, 3, 0, [0.1, 0.1, 0.4], 110.0), result(1, 0, 1, [], 100.0), None]
    without = [result(0, 0, 0, [], 100.0), result(0, 0, 0, [], 100.0), result(0, 0, 0, [], 100.0)]
    figures = victims.figures_of("random", found, without)
    assert figures["random.runs"] == 2
    assert figures["random.visible_found_share"] == 0.75
    assert figures["random.position_error_m.median"] == pytest.approx(0.1)
    assert figures["random.victims.false_alarms.mean"] == 0.5
    assert figures["random.victims.present.sum"] == 8
    assert figures["random.sim_time_vs_without"] == pytest.approx(1.05)


@pytest.fixture
def network(tmp_path) -> tuple[Path, Path]:
    return darknet_files(tmp_path)


def test_a_frame_is_timed(network):
    figures = speed(VictimDetector.load(*network), 2, seed=2)
    assert set(figures) == {"detector_ms"}
    assert min(figures.values()) > 0


def test_what_is_left_out_has_no_figures(network, tmp_path):
    nothing = {"scenes": 0, "rounds": 0, "nist": 0, "esogu": 0, "random": 0}
    outcome = victims.measure(VictimsSettings(detector=network, runs=tmp_path / "runs", **nothing))
    assert outcome.figures == {}
    assert json.dumps(outcome.details)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"scenes": -1}, "--scenes"),
        ({"frames": 0}, "--frames 0"),
        ({"detector": (Path("a.cfg"), Path("b"))}, "a.cfg: "),
    ],
)
def test_what_cannot_be_measured_is_refused(flags, message, network, tmp_path):
    with pytest.raises(InputError, match=message):
        victims.measure(VictimsSettings(**({"detector": network, "runs": tmp_path} | flags)))
