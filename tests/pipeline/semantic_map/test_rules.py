"""The rules on frames of simple scenes."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.semantic_map.rules import RuleClassifier, tilt_and_roughness
from tests.pipeline.polygon_scene import floor, look, pose, wall, wedge

SCENE = [
    floor(-5, 5, -5, 5),
    wall((3, -3), (3, 3)),
    *wedge(1.2, 0.6, 1.0, 1.0, 0.3),
    floor(1.2, 2.4, -1.2, -0.3, 0.3, Label.STRAIGHT_RAMP),
]
EYE = pose(0, 0, 0.6, 0.0, 0.2)


def test_most_points_of_a_simple_scene_get_the_right_labels() -> None:
    frame = look(SCENE, EYE, sigma=0.003)
    probabilities = RuleClassifier().classify(frame, frame.points(EYE), EYE)
    assert probabilities.dtype == np.float32
    assert (probabilities.sum(axis=1) == 1).all()
    labels, truth = probabilities.argmax(axis=1), frame.label[frame.returns]
    for label in (Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP):
        of_label = truth == label
        assert of_label.sum() > 5000
        assert (labels[of_label] == label).mean() > 0.85, label


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_tiny_clouds_get_labels(count: int) -> None:
    frame = look(SCENE, EYE)
    assert RuleClassifier().classify(frame, frame.points(EYE)[:count], EYE).shape == (count, 8)


def test_points_that_are_nowhere_are_unlabelled() -> None:
    frame = look(SCENE, EYE)
    points = frame.points(EYE)
    points[7] = np.nan
    probabilities = RuleClassifier().classify(frame, points, EYE)
    assert probabilities[7].argmax() == Label.UNLABELLED
    assert probabilities[8].argmax() != Label.UNLABELLED


def test_tilt_and_roughness_of_a_plane() -> None:
    xy = np.random.default_rng(0).uniform(0, 1, (500, 2))
    points = np.column_stack([xy, xy[:, 0] * np.tan(0.3)]).astype(np.float32)
    tilt, roughness = tilt_and_roughness(points, 20)
    assert tilt == pytest.approx(np.full(500, 0.3), abs=1e-3)
    assert roughness.max() < 1e-6
