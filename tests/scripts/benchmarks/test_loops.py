"""A short tour from its recording to its figures, and what counts as off."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.transforms import from_yaw
from scripts.benchmarks import loops, runs
from scripts.benchmarks.loops import figures_of, measure
from scripts.benchmarks.loops.scores import offsets
from scripts.benchmarks.loops.tours import Tour
from scripts.benchmarks.settings import LoopsSettings
from tests.sarsim.dataset.small import InProcess


def test_a_tour_is_recorded_once_and_scored(tmp_path: Path) -> None:
    settings = LoopsSettings(worlds=("wings",), seeds=(0,), length=8.0, runs=tmp_path, workers=1)
    result = measure(settings)
    tour = Tour.load(tmp_path / "wings-0-8.npz")
    assert result.figures["worlds"] == 1
    assert 8 < result.figures["path_m"] < 40  # with the way by which it was carried
    assert result.figures["ate_m"] < 0.1
    assert result.figures["wings.constraints"] > 5
    assert result.figures["false"] == 0
    assert sum(1 for _ in tour.frames()) == len(tour.true)
    assert measure(settings).figures == result.figures


def test_scores_of_other_settings_or_of_an_older_version_are_not_reused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    of_a_tour = dict.fromkeys((*loops.SUMMED, *loops.MEDIANS), 1.0) | {"linked": 1, "nees": {}, "relative_nees": {}}
    monkeypatch.setattr(loops, "run_tour", lambda job, folder: {"scores": of_a_tour})
    monkeypatch.setattr(runs, "make_engine", lambda workers: InProcess())
    settings = LoopsSettings(worlds=("a/room.xml",), seeds=(0,), length=8.0, runs=tmp_path)
    assert measure(settings).figures["room.ate_m"] == measure(settings).figures["room.ate_m"] == 1
    with pytest.raises(InputError, match="room-0-8"):
        measure(replace(settings, worlds=("b/room.xml",)))
    (file,) = tmp_path.glob("*.json")
    content = json.loads(file.read_text())
    for older in (content["settings"] | {"version": "0"}, content["settings"] | {"length": 9.0}):
        file.write_text(json.dumps(content | {"settings": older}))
        with pytest.raises(InputError, match="room-0-8"):
            measure(settings)


def test_the_reason_why_a_tour_failed_is_in_its_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("no way to the next waypoint")

    monkeypatch.setattr(loops, "record", fails)
    monkeypatch.setattr(runs, "make_engine", lambda workers: InProcess())
    with pytest.raises(InputError, match="ring-3-8"):
        measure(LoopsSettings(worlds=("ring",), seeds=(3,), length=8.0, runs=tmp_path))
    assert "no way to the next waypoint" in (tmp_path / "ring-3-8.log").read_text()


def test_a_constraint_is_off_only_in_directions_that_it_determines() -> None:
    """It is 1 m off along x and 0.3 m off along y, and determines y alone."""
    true = np.stack([np.eye(4), from_yaw(3, 0, 0, 0)])
    measured, whitening = from_yaw(4, 0.3, 0, 0), np.zeros((6, 6))
    whitening[4, 4] = 1e3
    ends = np.array([0]), np.array([1])
    off, angle = offsets(true, *ends, measured[None], whitening[None])
    assert off[0] == pytest.approx(0.3, rel=1e-3)
    assert angle[0] == 0
    off, _ = offsets(true, *ends, measured[None], 1e3 * np.eye(6)[None])
    assert off[0] == pytest.approx(np.hypot(1, 0.3), rel=1e-3)


def test_counts_are_summed_and_the_rest_is_the_median() -> None:
    tours = [
        {
            "revisits": n,
            "linked": 1,
            "constraints": 10,
            "false": n,
            "closures": 1,
            "false_closures": 0,
            "ate_m": 0.1 * n,
            "ate_percent": n,
            "path_m": 9,
            "keyframes": 5,
            "frame_ms": 1,
            "settle_ms": 1,
            "nees": {"50": [0.5 * n]},
            "relative_nees": {"10": [1.0, 2.0]},
        }
        for n in (1, 2, 5)
    ]
    figures = figures_of(tours)
    assert (figures["revisits"], figures["false"], figures["linked"]) == (8, 8, 3 / 8)
    assert figures["ate_m"] == pytest.approx(0.2)
    assert figures["nees.50"] == pytest.approx((0.5 + 1 + 2.5) / 3)
    assert figures["relative_nees.10"] == 1.5
