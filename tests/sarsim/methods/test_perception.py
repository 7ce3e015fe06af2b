"""What ``--labels`` names."""

import sys
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.rules import RuleClassifier
from sarsim.methods.perception import make_classifier
from sarsim.settings import WEIGHTS

OWN = (
    "import numpy as np\nclass Mine:\n    def classify(self, frame, points, T_map_camera):\n"
    "        return np.full((len(points), 8), 0.125, np.float32)\n"
)


def test_labels_come_from_rules_the_simulator_or_a_class_of_the_users(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_labels.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    path = list(sys.path)
    assert isinstance(make_classifier("rules", WEIGHTS), RuleClassifier)
    assert isinstance(make_classifier("truth", WEIGHTS), TruthClassifier)
    assert type(make_classifier("own_labels:Mine", WEIGHTS)).__name__ == "Mine"
    assert sys.path == path


@pytest.mark.parametrize(
    ("labels", "said"),
    [("magic", "pointnet, .*, rules, truth or MODULE:CLASS"), ("fractions:Fraction.x", "no attribute")],
)
def test_labels_that_nothing_gives_are_refused(labels: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make_classifier(labels, WEIGHTS)
