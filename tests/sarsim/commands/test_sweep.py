"""The command that sweeps: complete, resumable, the same bytes again."""

import json
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.errors import InputError
from sarsim.commands.sweep import SUMMARY, SweepSettings, sweep
from sarsim.commands.sweeps import episodes
from sarsim.commands.sweeps.arenas import checksum
from sarsim.commands.sweeps.episodes import SweepJob
from sarsim.commands.sweeps.leaderboard import TABLE_COLUMNS, read_entry
from sarsim.robots.names import robot_file
from sarsim.scoring.progress import ExploredCurve
from tests.sarsim.dataset.small import InProcess
from tests.sarsim.rooms import room

OWN = "class Own:\n    pass\n"


def run_and_score(job: SweepJob, settings: Mapping[str, Any]) -> Any:
    """An episode that is made up: a class of one's own fails."""
    if ":" in job.method:
        raise ValueError("no")
    times = np.array([0.0, 10.0 + job.seed])
    seen = {"exploration.explored_fraction": 1.0, "exploration.t99_s": times[1], "exploration.auc_time": 1.0}
    figures = seen | {"exploration.auc_way": 1.0, "sim_time_s": times[1], "navigation.distance_m": 5}
    return {"checksum": "c"} | figures, ExploredCurve(times, times / 2, np.array([0.0, 1.0]))


@pytest.fixture
def settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SweepSettings:
    (tmp_path / "mine_too.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(episodes, "run_and_score", run_and_score)
    monkeypatch.setattr("sarsim.commands.sweep.make_engine", lambda name, workers: InProcess())
    return SweepSettings(methods=("random_walk", "mine_too:Own"), seeds=(0, 1), out=tmp_path / "out", workers=1)


def test_a_method_that_fails_costs_its_own_episodes_alone(
    settings: SweepSettings, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep(settings)
    lines = [line for line in capsys.readouterr().err.splitlines() if "Own" in line]
    assert lines == ["mine_too:Own: 2 of its episodes failed: ValueError: no"]
    rows = pq.read_table(settings.out / "episodes.parquet").to_pylist()
    assert len(rows) == 4 and sum(row["failed"] is None for row in rows) == 2
    assert {row["checksum"] for row in rows} == {"c"}
    entries = [read_entry(file) for file in (settings.out / "entries").iterdir()]
    assert len(entries) == 2 and len({entry.comparison_key for entry in entries}) == 1
    again = replace(settings, out=settings.out.with_name("[b]again"))
    sweep(again)
    for name in ("episodes.parquet", "sweep.html"):
        assert (again.out / name).read_bytes() == (settings.out / name).read_bytes()
    assert f"Page: {again.out / 'sweep.html'}" in capsys.readouterr().out


def test_what_was_run_is_kept_and_another_version_refused(settings: SweepSettings) -> None:
    few = replace(settings, methods=("nearest_frontier",), seeds=(0,))
    sweep(few)
    (file,) = (few.out / "episodes").iterdir()
    before = file.stat().st_mtime_ns
    sweep(replace(few, seeds=(0, 1)))
    assert file.stat().st_mtime_ns == before and len(list(file.parent.iterdir())) == 2
    manifest = few.out / "sweep.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"version": "0.0.1"}))
    with pytest.raises(InputError, match=r"0\.0\.1"):
        sweep(few)


def test_episodes_of_other_settings_are_not_mixed(settings: SweepSettings) -> None:
    few = replace(settings, methods=("nearest_frontier",))
    sweep(few)
    changes: list[dict[str, Any]] = [{"robot": "jackal"}, {"labels": "rules"}, {"detector": None}, {"steps": 7}]
    for change in changes:
        with pytest.raises(InputError, match="".join(change)):
            sweep(replace(few, **change))


def test_results_of_another_state_of_ones_own_files_are_not_reused(settings: SweepSettings, tmp_path: Path) -> None:
    method, robot = tmp_path / "changing.py", tmp_path / "robot.xml"
    method.write_text(OWN)
    robot.write_text(robot_file("jackal").read_text())
    few = replace(settings, methods=("nearest_frontier",), robot=str(robot))
    sweep(few)
    for _ in range(2):
        sweep(replace(few, methods=("nearest_frontier", "changing:Own")))
    method.write_text(OWN + "# changed\n")
    with pytest.raises(InputError, match="changing:Own"):
        sweep(replace(few, methods=("changing:Own",)))
    sweep(few)
    robot.write_text(robot.read_text() + "\n")
    with pytest.raises(InputError, match=r"robot\.xml"):
        sweep(few)


def test_results_of_other_uncommitted_changes_are_not_reused(
    settings: SweepSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*words: str) -> None:
        identity = "-c", "user.name=N", "-c", "user.email=e@x"
        subprocess.run(["git", *identity, *words], cwd=tmp_path, check=True, capture_output=True)

    code = tmp_path / "pipeline" / "code.py"
    code.parent.mkdir()
    code.touch()
    git("init")
    git("add", "pipeline")
    git("commit", "-m", "Begin")
    monkeypatch.setattr("sarsim.commands.sweep.ROOT", tmp_path)
    monkeypatch.setattr("sarsim.commands.sweep.state_of_code", lambda: "abc+")
    few = replace(settings, methods=("nearest_frontier",))
    code.write_text("a = 1\n")
    sweep(few)
    sweep(few)
    code.write_text("a = 2\n")
    with pytest.raises(InputError, match="uncommitted"):
        sweep(few)


def test_results_in_an_arena_that_has_changed_are_not_reused(
    settings: SweepSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def with_checksum(job: SweepJob, settings: Mapping[str, Any]) -> Any:
        row, curve = run_and_score(job, settings)
        return row | {"checksum": checksum(job.arena)}, curve

    monkeypatch.setattr(episodes, "run_and_score", with_checksum)
    arena = tmp_path / "room.xml"
    few = replace(settings, methods=("nearest_frontier",), arenas=(str(arena),))
    arena.write_text(room((-0.6, 1.4), (-0.8, 0.8)))
    sweep(few)
    sweep(few)
    arena.write_text(room((-0.6, 1.5), (-0.8, 0.8)))
    with pytest.raises(InputError, match=r"room\.xml"):
        sweep(few)


def test_a_sweep_in_which_every_episode_failed_ends_with_status_1(settings: SweepSettings) -> None:
    with pytest.raises(SystemExit) as ended:
        sweep(replace(settings, methods=("mine_too:Own",)))
    assert ended.value.code == 1


def test_printed_columns_are_columns_of_the_tables() -> None:
    assert set(SUMMARY) <= {"method", *TABLE_COLUMNS, "failed"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        *(
            ({"methods": ("random_walk", m)}, f"--methods {m}")
            for m in ("nearest", "mine_too:Missing", "missing:Own")
        ),
        ({"arenas": ()}, "--arenas: give at least one"),
        ({"seeds": ()}, "--seeds: give at least one"),
        ({"seeds": (0, -1)}, "--seeds 0 -1: must not be negative"),
        ({"limit": 0.0}, "limit 0: must be positive"),
        ({"steps": 0}, "--steps 0: must be at least 1"),
        ({"workers": 0}, "--workers 0"),
    ],
)
def test_what_cannot_be_swept_is_refused_before_anything_runs(
    settings: SweepSettings, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        sweep(replace(settings, **changes))
    assert not settings.out.exists()
