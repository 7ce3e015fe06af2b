import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.labels import Label
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import (
    F1_DISTANCES,
    SurfaceScore,
    confusion_matrix,
    f1_scores,
    iou_by_label,
    map_figures,
)

WALL, FLOOR, RAMP = Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP


def test_confusion_and_iou_by_hand():
    truth = np.array([WALL, WALL, WALL, FLOOR, FLOOR, 0], np.uint8)
    guess = np.array([WALL, WALL, FLOOR, FLOOR, RAMP, WALL], np.uint8)
    confusion = confusion_matrix(truth, guess)
    assert confusion[WALL, FLOOR] == 1
    assert confusion.sum() == 5
    assert iou_by_label(confusion) == pytest.approx({WALL: 2 / 3, FLOOR: 1 / 3})


def test_the_map_is_compared_voxel_by_voxel_with_the_true_labels():
    semantic_map, true_map = SemanticMap(), SemanticMap()
    points = np.array([(0.01, 0.01, 0.01), (0.5, 0, 0), (1, 0, 0), (1.5, 0, 0)], np.float32)
    truth = np.array([WALL, WALL, FLOOR, FLOOR], np.uint8)
    guess = np.array([WALL, FLOOR, FLOOR, FLOOR], np.uint8)
    true_map.update(points, np.eye(8, dtype=np.float32)[truth])
    semantic_map.update(points, np.eye(8, dtype=np.float32)[guess])
    report = map_figures(true_map, semantic_map)
    assert report["accuracy"] == 0.75
    assert report["iou"] == pytest.approx({"wall": 1 / 2, "terrain": 2 / 3})
    assert report["miou_four"] == pytest.approx(7 / 12)
    assert report["points"] == 4


def test_a_robot_that_saw_nothing_has_no_figures():
    assert map_figures(SemanticMap(), SemanticMap()) == {}


def cloud(*xs: float) -> np.ndarray:
    return np.array([(x, 0, 0) for x in xs], np.float32).reshape(-1, 3)


def test_a_point_7_cm_off_is_right_within_10_cm_and_wrong_within_5() -> None:
    # Of two points one is right within 5 cm; of the three of the surface, two have a point so near.
    figures = f1_scores(cloud(1.0, 2.07), cloud(1.0, 1.04, 2.0))
    assert figures == pytest.approx({"f1_5cm": 2 * (1 / 2) * (2 / 3) / (1 / 2 + 2 / 3), "f1_10cm": 1.0})


def test_without_a_map_nothing_is_right_and_without_a_surface_there_are_no_figures() -> None:
    score = SurfaceScore(0.02)
    assert score.report(cloud(1.0)) == {}
    score.add(cloud(1.0))
    assert score.report(cloud()) == score.report(cloud(9.0)) == dict.fromkeys(F1_DISTANCES, 0.0)


def test_frames_are_thinned_as_one_cloud() -> None:
    score, rng = SurfaceScore(0.02), np.random.default_rng(0)
    frames = [rng.uniform(0, 0.3, (500, 3)).astype(np.float32) for _ in range(5)]
    for frame in frames:
        score.add(frame)
    assert score.report(np.concatenate(frames)) == dict.fromkeys(F1_DISTANCES, 1.0)


@given(hnp.arrays(np.float32, st.tuples(st.integers(1, 20), st.just(3)), elements=st.floats(-1, 1, width=32)))
def test_map_and_surface_may_change_places(points: np.ndarray) -> None:
    other = np.array([(0.5, 0, 0)], np.float32)
    there, back = f1_scores(points, other), f1_scores(other, points)
    assert there == pytest.approx(back)
    assert 0 <= there["f1_5cm"] <= 1 and 0 <= there["f1_10cm"] <= 1
