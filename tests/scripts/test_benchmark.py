"""The file that a benchmark leaves, and the camera's subject in small."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.errors import InputError
from sarsim.scripts import benchmark
from sarsim.scripts.benchmarks import camera
from sarsim.scripts.benchmarks.camera import Camera, Times
from sarsim.scripts.benchmarks.subject import Result, Subject


@dataclass(frozen=True)
class Toy(Subject):
    """A subject that measures nothing."""

    rounds: int = 3
    source: Path = Path("somewhere")

    def measure(self) -> Result:
        """One figure."""
        return Result({"toy_vs_peer": 2.5}, {"rounds": [1, 2, 3]})


def test_the_file_says_what_was_measured_where_and_how(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "toy.json"
    benchmark.benchmark(Toy(json=file), "toy")
    content = json.loads(file.read_text())
    assert content["subject"] == "toy"
    assert content["version"].count(".") == 2
    assert content["machine"]["cores"] >= 1
    assert content["machine"]["packages"]["mujoco"]
    assert content["config"] == {"rounds": 3, "source": "somewhere"}
    assert content["figures"] == {"toy_vs_peer": 2.5}
    assert content["rounds"] == [1, 2, 3]
    assert [path.name for path in tmp_path.iterdir()] == ["toy.json"]
    assert "toy_vs_peer" in capsys.readouterr().out


def test_a_missing_folder_is_found_before_the_work_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Toy, "measure", lambda self: pytest.fail("measured for nothing"))
    with pytest.raises(InputError, match=r"--json .*nowhere/toy.json"):
        benchmark.benchmark(Toy(json=tmp_path / "nowhere" / "toy.json"), "toy")


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "toy.json").mkdir()
    with pytest.raises(InputError, match=r"toy\.json"):
        benchmark.benchmark(Toy(json=tmp_path / "toy.json"), "toy")
    assert [path.name for path in tmp_path.iterdir()] == ["toy.json"]


def test_an_unknown_subject_is_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["benchmark.py", "coffee"])
    with pytest.raises(SystemExit) as raised:
        benchmark.main()
    assert raised.value.code == 2
    assert "coffee" in capsys.readouterr().err


def test_ratios_are_medians_over_rounds() -> None:
    ours, theirs = [10.0, 20.0, 40.0], [30.0, 80.0, 100.0]
    times = {name: [Times(t, {"part": t / 2}) for t in theirs] for name in camera.CONTENDERS}
    times["ours"] = [Times(t, {"part": t / 5}) for t in ours]
    figures = camera._figures(times)
    assert figures["frame_vs_renderer"] == 3.0  # of 3, 4 and 2.5
    assert figures["ours.frame_ms"] == 20.0
    assert figures["ours.part_ms"] == 4.0
    assert figures["renderer.part_ms"] == 40.0


@pytest.mark.parametrize("flags", [{"frames": 0}, {"width": 0}, {"height": -1}])
def test_a_picture_of_nothing_is_refused(flags: dict[str, int]) -> None:
    with pytest.raises(InputError, match="at least 1"):
        Camera(**flags).measure()


def test_the_camera_is_measured_against_the_renderer(capsys: pytest.CaptureFixture[str]) -> None:
    figures = Camera(frames=1, width=64, height=48).measure().figures
    assert figures["frame_vs_renderer"] > 0
    parts = {name.split(".")[1] for name in figures if name.startswith("renderer.")}
    assert parts == {"frame_ms", "colour_ms", "depth_ms", "segmentation_ms"}
