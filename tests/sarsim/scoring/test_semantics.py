import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.scoring.semantics import compared, confusion_matrix, iou_by_label

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
    report = compared(true_map, semantic_map)
    assert report["accuracy"] == 0.75
    assert report["iou"] == pytest.approx({"wall": 1 / 2, "terrain": 2 / 3})
    assert report["miou_four"] == pytest.approx(7 / 12)
    assert report["points"] == 4


def test_a_robot_that_saw_nothing_has_no_figures():
    assert compared(SemanticMap(), SemanticMap()) == {}
