"""The accuracy part of the semantic map's benchmark."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.semantic_map.classifier import TruthClassifier
from scripts.benchmarks import semantic
from scripts.benchmarks.labelled_drives import PosedFrame, drive_through
from scripts.benchmarks.semantic_accuracy import accuracy
from scripts.benchmarks.settings import SemanticSettings


@pytest.fixture(scope="module")
def frames() -> list[PosedFrame]:
    return list(drive_through("nist_6x4", 2, seed=0))


class Half(TruthClassifier):
    """Takes every other wall for terrain."""

    def classify(self, frame, points, T_map_camera):
        probabilities = super().classify(frame, points, T_map_camera)
        walls = np.flatnonzero(probabilities[:, Label.WALL])[::2]
        probabilities[walls, Label.WALL], probabilities[walls, Label.TERRAIN] = 0, 1
        return probabilities


def test_the_truth_is_right_and_the_rules_are_not_quite(frames: list[PosedFrame]) -> None:
    figures = accuracy(frames, TruthClassifier())
    assert figures["network"]["miou_four"] == 1
    assert figures["fused"]["miou_four"] == 1
    assert 0.4 < figures["baseline"]["miou_four"] < 1


def test_errors_count_for_both_classes(frames: list[PosedFrame]) -> None:
    figures = accuracy(frames, Half())["network"]
    labels = np.concatenate([frame.labels for frame in frames])
    walls, terrain = (int((labels == label).sum()) for label in (Label.WALL, Label.TERRAIN))
    assert figures["wall"] == pytest.approx(0.5, abs=0.01)
    assert figures["terrain"] == pytest.approx(terrain / (terrain + walls / 2), abs=0.01)


def test_without_a_network_there_is_the_baseline_alone(frames: list[PosedFrame]) -> None:
    assert set(accuracy(frames[:1], None)) == {"baseline"}


def test_figures_have_the_agreed_names() -> None:
    assert semantic.key("nist_6x4", "network") == "miou_four.nist_6x4.network"
    assert semantic.key("nist_6x4.dark", "fused") == "miou_four.nist_6x4.fused.dark"
    details = {
        name: {"network": {"miou_four": value}}
        for name, value in {"raf.a": 0.5, "raf.b": 0.7, "raf.a.dark": 0.25, "nist_6x4": 1.0}.items()
    }
    assert semantic.raf_means(details) == {
        "miou_four.raf_mean.network": pytest.approx(0.6),
        "miou_four.raf_mean.network.dark": 0.25,
    }


@pytest.mark.parametrize("change", [{"rounds": 0}, {"timed_frames": 0}, {"frames": -1}, {"raf_frames": -1}])
def test_nothing_to_measure_is_refused(change: dict[str, int]) -> None:
    with pytest.raises(InputError, match="at least"):
        semantic.measure(SemanticSettings(**change))
