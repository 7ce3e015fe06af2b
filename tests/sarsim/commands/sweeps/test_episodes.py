"""Episodes of a sweep: their rows, and what goes wrong in one."""

import json
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps import episodes
from sarsim.commands.sweeps.episodes import SweepJob, result_of, run_episode, time_limit
from sarsim.scoring.progress import area_under
from tests.sarsim.rooms import room

WHOLE = {"row": {}, "curve": {"time_s": [0, 1], "way_m": [0, 1], "explored": [0.1, 0.2]}, "processor_s": 1}
BROKEN = [WHOLE | {"row": 3}, WHOLE | {"curve": {}}, WHOLE | {"curve": WHOLE["curve"] | {"way_m": [0]}}]


def test_a_row_has_the_figures_of_a_report_and_a_curve_that_fits_them(tmp_path: Path) -> None:
    (tmp_path / "room.xml").write_text(room((-0.6, 1.4), (-0.8, 0.8)))
    job = SweepJob("nearest_frontier", str(tmp_path / "room.xml"), 0)
    run_episode({"steps": 2, "labels": "rules", "detector": None}, 600.0, job, tmp_path)
    row, curve, seconds = result_of(job, tmp_path)
    assert (row["method"], row["arena"], row["seed"], row["steps"]) == (*job.row.values(), 2)
    assert seconds > 0 and row["checksum"] and row["exploration.ended"] == "steps"
    for along, key, end in (
        (curve.time_s, "auc_time", "sim_time_s"),
        (curve.way_m, "auc_way", "navigation.distance_m"),
    ):
        assert area_under(along, curve.explored, row[end]) == pytest.approx(row[f"exploration.{key}"], rel=1e-3)
    assert curve.explored[-1] == pytest.approx(row["exploration.explored_fraction"], abs=5e-5)
    assert (np.diff(curve.explored) > 0).all()
    assert not any(episodes.RUN_SPECIFIC_KEYS.match(key) for key in set(row) - set(job.row))


def throws(job: SweepJob, settings: Mapping[str, Any]) -> Any:
    raise ValueError("a line\nand another")


def hangs(job: SweepJob, settings: Mapping[str, Any]) -> Any:
    while True:
        pass


@pytest.mark.parametrize(
    ("run_and_score", "complaint"),
    [(throws, "^ValueError: a line and another$"), (hangs, "^TimeoutError: exceeded the time limit of 1 s$")],
)
def test_what_is_wrong_with_a_method_is_said_in_one_line(
    run_and_score: Any, complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(episodes, "run_and_score", run_and_score)
    with pytest.raises(InputError, match=complaint):
        run_episode({}, 1.0, SweepJob("m", "nist_6x4", 0), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_block_that_ends_in_time_is_left_alone() -> None:
    with time_limit(60.0):
        assert signal.getitimer(signal.ITIMER_REAL)[0] > 0
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0


def test_files_of_different_episodes_have_different_names() -> None:
    jobs = [SweepJob(m, a, s) for m in ("a:B", "a_B") for a in ("x/y.raf", "x_y.raf") for s in (0, 1)]
    assert len({job.file for job in jobs}) == len(jobs)


@pytest.mark.parametrize("text", ["{", "[]", *map(json.dumps, BROKEN)])
def test_a_broken_result_is_reported(tmp_path: Path, text: str) -> None:
    job = SweepJob("m", "a", 0)
    (tmp_path / "episodes").mkdir()
    (tmp_path / job.file).write_text(text)
    with pytest.raises(InputError, match=r"not a valid episode result .*; delete it"):
        result_of(job, tmp_path)
    (tmp_path / job.file).write_text(json.dumps(WHOLE))
    assert result_of(job, tmp_path).processor_s == 1
