"""Truth as a classifier."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import TruthClassifier
from tests.pipeline.polygon_scene import floor, look, pose

FRAME = look([floor(-5, 5, -5, 5)], pose(0, 0, 0.6, 0.0, 0.3))


def test_truth_is_the_label_of_every_return_in_order() -> None:
    labels = np.arange(FRAME.depth.size, dtype=np.uint8).reshape(FRAME.depth.shape) % 8
    probabilities = TruthClassifier().classify(replace(FRAME, label=labels), FRAME.points(np.eye(4)), np.eye(4))
    assert probabilities.dtype == np.float32
    assert probabilities.shape == (np.count_nonzero(FRAME.returns), 8)
    assert (probabilities.argmax(axis=1) == labels[FRAME.depth > 0]).all()
    assert (probabilities.sum(axis=1) == 1).all()


def test_frame_without_labels_is_refused() -> None:
    with pytest.raises(InputError, match="no true labels"):
        TruthClassifier().classify(replace(FRAME, label=None), FRAME.points(np.eye(4)), np.eye(4))
