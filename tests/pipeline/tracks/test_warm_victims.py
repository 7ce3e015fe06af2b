"""What is warm of a person is one find; what is warm elsewhere is a find of its own."""

import numpy as np

from pipeline.tracks.find import Find
from pipeline.tracks.finds import one_per_person
from pipeline.tracks.track import Track
from tests.pipeline.rescue_report.people import victim

REACH = {"heat": 0.4, "fire_extinguisher": 0.15, "door_lever": 0.15}
PHOTO = np.zeros((2, 2, 3), np.uint8)


def find(kind: str, x: float, time: float = 1.0) -> Find:
    return Find(kind, "", np.array([x, 0, 0.1]), np.eye(3), time, 1.0, PHOTO)


def lying(x: float) -> Track:
    """A person of 1.6 m along x around ``x``."""
    points = np.column_stack([np.linspace(x - 0.8, x + 0.8, 33), np.zeros(33), np.full(33, 0.1)]).astype(np.float32)
    return victim(points, cameras=1)


def test_the_warm_parts_of_a_person_are_one_find_in_its_middle() -> None:
    finds = [find("heat", 2.3, 5.0), find("heat", 3.7, 3.0), find("heat", 9.0), find("qr_code", 3.0)]
    left = list(one_per_person(finds, [lying(3.0)], [], REACH))
    assert [(f.kind, f.time_s) for f in left] == [("heat", 1.0), ("qr_code", 1.0), ("heat", 3.0)]
    np.testing.assert_allclose(left[0].position, [9, 0, 0.1])
    assert [f.is_heat_of_person for f in left] == [False, False, True]
    np.testing.assert_allclose(left[2].position, [3, 0, 0.1], atol=0.02)
    np.testing.assert_allclose(left[2].covariance, np.eye(3) / 100)


def test_each_person_is_warm_once() -> None:
    left = list(
        one_per_person([find("heat", 0.4), find("heat", 2.9), find("heat", 3.1)], [lying(0.0), lying(3.0)], [], REACH)
    )
    np.testing.assert_allclose([f.position[0] for f in left], [0, 3], atol=0.02)


def test_what_is_warm_of_a_suspected_person_is_one_find_and_what_looks_like_a_bottle_on_it_stays():
    bottle = find("fire_extinguisher", 2.5)
    left = list(one_per_person([find("heat", 2.3), find("heat", 3.7), bottle], [], [lying(3.0)], REACH))
    assert [f.kind for f in left] == ["fire_extinguisher", "heat"]
    np.testing.assert_allclose(left[1].position, [3, 0, 0.1], atol=0.02)


def test_without_people_all_finds_stay() -> None:
    finds = [find("heat", 0.0), find("april_tag", 1.0)]
    assert list(one_per_person(finds, [], [], REACH)) == finds


def test_what_looks_like_a_bottle_on_a_person_is_none() -> None:
    beside = find("fire_extinguisher", 4.1)
    left = one_per_person([find("fire_extinguisher", 3.5), find("door_lever", 2.5), beside], [lying(3.0)], [], REACH)
    assert list(left) == [beside]
