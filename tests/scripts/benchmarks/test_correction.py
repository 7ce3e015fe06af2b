from scripts.benchmarks import correction
from scripts.benchmarks.settings import CorrectionSettings


def test_corrected_maps_are_those_made_from_scratch(monkeypatch):
    monkeypatch.setattr(correction, "DRIVES", {"nist_6x4": 12})

    figures = correction.measure(CorrectionSettings(rounds=2)).figures

    assert figures["equal"] == 1
    assert 0 < figures["12.correction_s.median"] <= figures["12.correction_s.p95"]
    assert 1e3 < figures["12.bytes_per_keyframe"] < 1e7
