"""Pages of results: what is kept of a measurement, what is measured again, how figures become tables, and claims."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from scripts import results
from scripts.results import (
    ResultsSettings,
    check_claims,
    claim_row,
    holds,
    measure_page,
    measured_at,
    pages_config,
    readme_row,
    record_of,
    stored_figures,
    table_of,
    with_folder,
)

PAGE = {"title": "speed", "command": "benchmark.py camera", "minutes": 2, "about": "How fast.", "tables": []}
RECORD: dict[str, Any] = {
    "command": "benchmark.py camera --frames 8", "commit": "abc", "date": "2026-11-24", "figures": {"a.ms": 2.0},
    "machine": {"cores": 2, "processor": "P", "instructions": "AVX2"}, "processor_s": 240, "version": "0.1",
}  # fmt: skip
LEAST = {"claim": "fast", "page": "camera", "figure": "times", "least": 2}
MOST = {"claim": "exact", "page": "camera", "figure": "error", "most": 0.5}
TRUE = {"claim": "equal", "page": "camera", "figure": "a.ms", "is_true": True}


def test_numbers_are_kept_with_five_digits() -> None:
    figures = {".sim_time_s": 123.4567, "arena": "nist_6x4", "config.steps": 8, "missing": None, "runs": 3}
    assert stored_figures(figures) == {"sim_time_s": 123.46, "runs": 3.0}


def test_a_table_has_the_rows_that_have_a_figure() -> None:
    table = {"title": "ms", "rows": {"one": "a", "none": "b"}, "columns": {"ours": "x", "theirs": "y"}}
    figures = {"x.a": 12345.6, "y.b.c": 1.0}
    assert table_of(table | {"cell": "{column}.{row}"}, figures).splitlines() == [
        "| ms | ours | theirs |", "|---|---|---|", "| one | 12,346 | – |",
    ]  # fmt: skip
    assert table_of(table, {}) == ""


def test_a_table_may_have_a_row_for_each_figure_of_a_kind_the_lowest_first() -> None:
    table = {"title": "arena", "by": "seen", "columns": {"seen": "seen", "end": "end"}, "cell": "{row}.{column}"}
    figures = {"b.seen": 0.9, "a.seen": 0.5, "c.unseen": 0.1}
    assert table_of(table, figures, {"a.end": "held"}).splitlines()[2:] == ["| a | 0.5 | held |", "| b | 0.9 | – |"]


def test_folder_stands_for_a_folder_or_is_left_out(tmp_path: Path) -> None:
    command = "benchmark.py exploration --arenas nist_6x4 FOLDER --seeds 0"
    assert with_folder(command, None) == ("benchmark.py exploration --arenas nist_6x4 --seeds 0", {})
    assert with_folder(command, tmp_path) == (command, {"FOLDER": str(tmp_path)})
    with pytest.raises(InputError, match="--folder"):
        with_folder(command, tmp_path / "none")


def test_rows_of_the_readme() -> None:
    row = {"what": "speed", "page": "camera", "ours": "{a.ms:.1f} ms"}
    end = "[camera](docs/results/camera.md) |"
    assert readme_row(row, RECORD) == f"| speed | 2.0 ms | – | {end}"
    assert readme_row(row | {"baseline": "{a.ms:.0f} s"}, RECORD) == f"| speed | 2.0 ms | 2 s | {end}"
    unknown = readme_row(row | {"ours": "{b.ms:.1f} ms"}, RECORD)
    assert "not measured yet" in unknown and "make results PAGE=camera" in unknown
    assert readme_row(row, None) == unknown
    claim = {"claim": "fast", "page": "camera", "figure": "a.ms", "most": 2.5}
    assert measured_at([RECORD, None, RECORD]) == "Measured on 2026-11-24 at commit abc."
    assert claim_row(claim, PAGE, RECORD) == "| fast | [camera](docs/results/camera.md) | 2.0 | ≤ 2.5 | 2 |"
    assert claim_row(TRUE, PAGE, RECORD).endswith("| yes | no |") and not holds(TRUE, RECORD["figures"])


@pytest.mark.parametrize(
    ("old", "new", "again", "runs"),
    [("abc", "abc", False, 0), ("abc", "abc", True, 1), ("abc", "def", False, 1), ("abc+", "abc+", False, 1)],
)
def test_figures_of_this_state_are_not_measured_again(
    old: str, new: str, again: bool, runs: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands: list[str] = []

    def measured(
        command: str, folder: Path, environment: Mapping[str, str] = {}, given: Mapping[str, str] = {}
    ) -> dict[str, Any]:
        commands.append(command)
        return RECORD | {"command": command, "figures": {"ms": float(environment.get("SLOW", 1))}}

    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(results, "state_of_code", lambda: new)
    monkeypatch.setattr(results, "measure", measured)
    (tmp_path / "camera.json").write_text(json.dumps(RECORD | {"commit": old}))
    measure_page(
        "camera", PAGE | {"environments": {"old": {"SLOW": "3"}}}, ResultsSettings(again=again, flags="--frames 8")
    )
    assert commands == ["benchmark.py camera --frames 8"] * 2 * runs
    record = json.loads((tmp_path / "camera.json").read_text())
    assert record["commit"] == new
    assert not runs or record["figures"] == {"ms": 1.0, "old.ms": 3.0}


@pytest.mark.parametrize(
    ("commit", "again", "kept"), [("abc", False, True), ("abc", True, False), ("abc+", False, False)]
)
def test_finished_episodes_are_reused_only_by_an_interrupted_measurement_of_a_commit(
    commit: str, again: bool, kept: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(results, "ROOT", tmp_path)
    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(results, "state_of_code", lambda: commit)
    episodes = [tmp_path / "runs" / folder / "episode.json" for folder in (f"barn-{commit}", "mine")]
    for file in episodes:
        file.parent.mkdir(parents=True)
        file.touch()
    found: list[list[bool]] = []

    def measured(*_: object) -> dict[str, Any]:
        found.append([file.exists() for file in episodes])
        return dict(RECORD)

    monkeypatch.setattr(results, "measure", measured)
    page = PAGE | {"command": "benchmark.py barn --runs runs/barn-{commit}"}
    measure_page("barn", page, ResultsSettings(again=again, flags="--runs runs/mine"))
    assert found == [[kept, True]]  # a folder that the user names keeps its episodes


def test_an_environment_reaches_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "ROOT", tmp_path)
    (tmp_path / "scripts").mkdir()
    report = "{'version': '1', 'n': int(os.environ['N'])}"
    program = f"import json, os, sys\njson.dump({report}, open(sys.argv[-1] + '/report.json', 'w'))"
    (tmp_path / "scripts" / "run_episode.py").write_text(program)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "left.json").touch()  # of an earlier one
    assert results.measure("run_episode.py", tmp_path / "out", {"N": "7"})["figures"] == {"n": 7.0}
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["report.json"]


def test_a_page_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(InputError, match=r"speed: .*metric-map"):
        results.results(ResultsSettings(pages=("speed",)))


@pytest.mark.parametrize(("figure", "held"), [(1.9, False), (2.0, True), (2.1, True), (float("nan"), False)])
def test_a_claim_holds_from_its_bound_on(figure: float, held: bool) -> None:
    assert holds(LEAST, {"times": figure}) is held
    assert holds({"figure": "times", "most": 2}, {"times": 4 - figure}) is held
    assert not holds(LEAST, {})


def test_all_claims_of_a_command_are_checked_by_one_run_without_earlier_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[str] = []

    def measured(command: str, folder: Path) -> dict[str, Any]:
        assert not episode.exists()
        commands.append(command)
        return {"figures": {"times": 3.0, "error": 0.6}}

    command = "benchmark.py camera FOLDER --runs runs/camera-{commit}"
    content = {"pages": {"camera": {"command": command}}, "claims": [LEAST, MOST]}
    episode = tmp_path / "runs" / "camera-abc" / "episode.json"
    episode.parent.mkdir(parents=True)
    episode.touch()
    monkeypatch.setattr(results, "ROOT", tmp_path)
    monkeypatch.setattr(results, "state_of_code", lambda: "abc")
    monkeypatch.setattr(results, "pages_config", lambda: content)
    monkeypatch.setattr(results, "measure", measured)
    with pytest.raises(SystemExit):
        check_claims()
    assert commands == ["benchmark.py camera --runs runs/camera-abc"]
    assert capsys.readouterr().out.splitlines() == [
        "holds  fast: 3, expected ≥ 2", "FAILS  exact: 0.6, expected ≤ 0.5",
    ]  # fmt: skip


def test_every_claim_held_when_its_page_was_measured() -> None:
    for claim in pages_config()["claims"]:
        record = record_of(claim["page"])
        assert record and holds(claim, record["figures"]), claim["claim"]
