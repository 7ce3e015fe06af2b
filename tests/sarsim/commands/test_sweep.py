"""The command that sweeps: complete, resumable, the same bytes again."""

import json
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from pipeline.errors import InputError
from sarsim.commands.sweep import SUMMARY, SweepSettings, sweep
from sarsim.commands.sweeps.leaderboard import TABLE_COLUMNS, read_entry
from tests.sarsim.dataset.small import InProcess

THROWS = "class Throws:\n    def __call__(self, world, sights, rng):\n        raise ValueError('no')\n"


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SweepSettings:
    (tmp_path / "mine_too.py").write_text(THROWS)
    monkeypatch.chdir(tmp_path)
    methods = ("random_walk", "mine_too:Throws")
    return SweepSettings(methods=methods, arenas=("grid:test:2",), seeds=(0, 1), out=tmp_path / "out", workers=1)


def test_a_method_that_fails_costs_its_own_episodes_alone(
    settings: SweepSettings, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep(settings)
    lines = [line for line in capsys.readouterr().err.splitlines() if "Throws" in line]
    assert lines == ["mine_too:Throws: 2 of its episodes failed: --methods mine_too:Throws failed: ValueError: no"]
    rows = pq.read_table(settings.out / "episodes.parquet").to_pylist()
    assert len(rows) == 4 and sum(row["failed"] is None for row in rows) == 2
    walks = [row["exploration.auc_way"] for row in rows if row["method"] == "random_walk"]
    assert len(set(walks)) == 2
    entries = [read_entry(file) for file in (settings.out / "entries").iterdir()]
    assert len(entries) == 2 and len({entry.board for entry in entries}) == 1
    again = replace(settings, out=settings.out.with_name("again"))
    monkeypatch.setattr("sarsim.commands.sweep.make_engine", lambda name, workers: InProcess())
    sweep(again)
    for name in ("episodes.parquet", "sweep.html"):
        assert (again.out / name).read_bytes() == (settings.out / name).read_bytes()
    assert f"Page: {again.out / 'sweep.html'}" in capsys.readouterr().out


def test_what_was_run_is_kept_and_another_version_refused(
    settings: SweepSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sarsim.commands.sweep.make_engine", lambda name, workers: InProcess())
    few = replace(settings, methods=("nearest_frontier",), arenas=("grid:test:2",), seeds=(0,))
    sweep(few)
    (file,) = (few.out / "episodes").iterdir()
    before = file.stat().st_mtime_ns
    sweep(replace(few, seeds=(0, 1)))
    assert file.stat().st_mtime_ns == before and len(list(file.parent.iterdir())) == 2
    manifest = few.out / "sweep.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"version": "0.0.1"}))
    with pytest.raises(InputError, match=r"0\.0\.1"):
        sweep(few)


def test_a_sweep_in_which_every_episode_failed_ends_with_a_status_that_says_so(
    settings: SweepSettings, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sarsim.commands.sweep.make_engine", lambda name, workers: InProcess())
    with pytest.raises(SystemExit) as ended:
        sweep(replace(settings, methods=("mine_too:Throws",)))
    assert ended.value.code == 1
    assert "2 of its episodes failed" in capsys.readouterr().err


def test_printed_columns_are_columns_of_the_tables() -> None:
    assert set(SUMMARY) <= {"method", *TABLE_COLUMNS, "failed"}


def test_methods_are_there_before_anything_runs(settings: SweepSettings) -> None:
    for method in ("nearest", "mine_too:Missing", "missing:Throws"):
        with pytest.raises(InputError, match=f"--methods {method}"):
            sweep(replace(settings, methods=("random_walk", method)))
        assert not settings.out.exists()


def test_a_sweep_of_nothing_is_refused(settings: SweepSettings) -> None:
    with pytest.raises(InputError, match="--seeds: give at least one"):
        sweep(replace(settings, seeds=()))
    with pytest.raises(InputError, match="--seeds 0 -1: must not be negative"):
        sweep(replace(settings, seeds=(0, -1)))
    with pytest.raises(InputError, match="limit 0: must be positive"):
        sweep(replace(settings, limit=0.0))
    with pytest.raises(InputError, match="steps 0: must be at least 1"):
        sweep(replace(settings, steps=0))
    with pytest.raises(InputError, match="--workers 0"):
        sweep(replace(settings, workers=0))
