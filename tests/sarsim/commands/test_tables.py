"""What a terminal shows at the end of a run."""

from pathlib import Path
from typing import Any

import pytest

from sarsim.commands.tables import show_results

REPORT: dict[str, Any] = {
    "arena": "nist_6x4",
    "seed": 0,
    "steps": 20,
    "sim_time_s": 141.0,
    "config": {"steps": None},
    "exploration": {"ended": "nothing_left", "explored_fraction": 0.99999},
    "navigation": {"legs": 35, "reached": 34, "collisions": 1, "tipped": 0, "distance_m": 31.34},
    "localisation": {"ate_rmse_m": 0.0114, "heading_rmse_deg": 0.113, "drift_percent": 0.2},
    "semantic_map": {"accuracy": 0.9963, "points": 235097, "miou_four": 0.987},
    "victims": {"present": 2, "found": 1, "false_alarms": 0, "position_error_m": 0.055},
    "faults": [],
}


def lines(report: dict[str, Any], folder: Path, capsys: pytest.CaptureFixture[str], every: bool = False) -> list[str]:
    show_results(report, folder, every)
    return capsys.readouterr().out.splitlines()


def test_a_run_ends_with_six_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "report.html").touch()
    explored, legs, pose, labels, people, results = lines(REPORT, tmp_path, capsys)
    assert "99.9%" in explored and "2:21 min" in explored  # what is not whole is not 100%
    assert "34 of 35" in legs and "1 contact " in legs
    assert "1.1 cm" in pose and "0.11°" in pose
    assert "99.6%" in labels and "0.987" in labels
    assert "1 of 2" in people and " cm off" in people
    assert "sarsim-view" in results and str(tmp_path / "report.html") in results


def test_every_figure_is_shown_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "\n".join(lines(REPORT, tmp_path, capsys, every=True))
    assert "localisation.drift_percent" in text and "config" not in text
    assert "localisation.drift_percent" not in "\n".join(lines(REPORT, tmp_path, capsys))


def test_an_arena_in_brackets_is_shown_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = lines(REPORT | {"arena": "a[/b]"}, tmp_path / "[b]c", capsys, every=True)
    assert "a[/b], seed 0" in "\n".join(shown) and f"results   {tmp_path / '[b]c'}" in shown[-1]


def test_a_viewer_is_called_by_its_name_unless_another_one_is_found_by_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found, beside = tmp_path / "found" / "sarsim-view", tmp_path / "python" / "sarsim-view"
    for file in (found, beside):
        file.parent.mkdir()
        file.touch(0o755)
    monkeypatch.setenv("PATH", str(found.parent))
    monkeypatch.setattr("sys.executable", str(beside.with_name("python")))
    monkeypatch.chdir(tmp_path)
    assert "recording: python/sarsim-view " in lines({}, tmp_path, capsys)[-1]
    beside.unlink()
    assert "recording: sarsim-view " in lines({}, tmp_path, capsys)[-1]
    beside.symlink_to(found)
    assert "recording: sarsim-view " in lines({}, tmp_path, capsys)[-1]


def test_what_has_no_truth_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = {"arena": "a.mcap", "seed": 0, "steps": 3, "sim_time_s": 5.0}
    explored, results = lines(recording, tmp_path, capsys)
    assert "3 steps" in explored and "report.html" not in results
    (nothing,) = lines({}, tmp_path, capsys)
    assert str(tmp_path) in nothing


def test_a_mission_shows_goals_points_and_faults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    goals = {"given": 3, "reached": 2, "refused": 1, "each": []}
    faults = [{"kind": "stuck", "time_s": 1.0, "text": "leg"}]
    league = {"map": {"points": 5.0}, "total": {"points": 12.0}}
    report = REPORT | {"goals": goals, "league": league, "faults": faults}
    explored, legs, *_ = lines(report, tmp_path, capsys)
    assert "12 points" in explored
    assert "2 of 3 goals" in legs and "1 fault " in legs
