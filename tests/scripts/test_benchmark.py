"""The file that a benchmark writes, and a small run of the subject "camera"."""

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from pipeline.errors import InputError
from sarsim.commands.provenance import instructions
from scripts import benchmark
from scripts.benchmarks import camera
from scripts.benchmarks.common import Result
from scripts.benchmarks.settings import CameraSettings, SubjectSettings
from tests.refusal import refusal


@dataclass(frozen=True, kw_only=True)
class Toy(SubjectSettings):
    raf: Path
    rounds: int = 3
    seed: int = 0


def toy(settings: Toy) -> Result:
    """Measures nothing, and leaves a picture."""
    picture = settings.raf / "worst.png"
    picture.write_bytes(b"picture")
    return Result({"toy_vs_peer": 2.5}, {"rounds": [1, 2, 3]}, pictures=(picture,))


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Replaces every subject by ``toy``; gives a folder for its picture."""
    monkeypatch.setattr(benchmark, "import_module", lambda name: SimpleNamespace(measure=toy))
    (tmp_path / "raf").mkdir()
    return tmp_path / "raf"


def test_the_file_says_what_was_measured_where_and_how(
    tmp_path: Path, toys: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "toy.json"
    benchmark.benchmark(Toy(json=file, raf=toys, seed=5), "camera")
    content = json.loads(file.read_text())
    assert content["subject"] == "camera"
    assert content["version"].count(".") == 2
    assert content["machine"]["cores"] >= 1
    assert content["machine"]["packages"]["mujoco"]
    assert content["machine"]["instructions"] == instructions()
    assert content["config"] == {"raf": str(toys), "rounds": 3, "seed": 5}
    assert content["figures"] == {"toy_vs_peer": 2.5}
    assert content["rounds"] == [1, 2, 3]
    assert (tmp_path / "toy-worst.png").read_bytes() == b"picture"
    assert yaml.safe_load((tmp_path / "toy.yaml").read_text())["seed"] == 5
    assert not list(tmp_path.glob("*.part"))
    printed = capsys.readouterr().out
    assert "toy_vs_peer" in printed
    assert instructions() in printed


def test_a_missing_folder_is_found_before_the_work_is_done(tmp_path: Path, toys: Path) -> None:
    with pytest.raises(InputError, match=r"--json .*nowhere/toy.json"):
        benchmark.benchmark(Toy(json=tmp_path / "nowhere" / "toy.json", raf=toys), "camera")
    assert not list(toys.iterdir())


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path, toys: Path) -> None:
    (tmp_path / "toy.json").mkdir()
    with pytest.raises(InputError, match=r"toy\.json"):
        benchmark.benchmark(Toy(json=tmp_path / "toy.json", raf=toys), "camera")
    assert {path.name for path in tmp_path.iterdir()} == {"toy.json", "raf"}


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["coffee"], "unknown subcommand 'coffee': must be one of barn, camera, "),
        (["camra"], "; perhaps you meant camera"),
        (["camera", "--raf", "folder"], "--raf"),
        (["dataset", "--nist", "3"], "--nist"),
        (["victims", "--detector", "None"], "--detector"),
    ],
)
def test_what_cannot_be_measured_is_status_2(
    flags: list[str], complaint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["benchmark.py", *flags])
    assert complaint in refusal(capsys, benchmark.main)


def test_ratios_are_medians_over_rounds() -> None:
    ours, theirs = [10.0, 20.0, 40.0], [30.0, 80.0, 100.0]
    times = {name: [{"frame": t, "part": t / 2} for t in theirs] for name in camera.CONTENDERS}
    times["ours"] = [{"frame": t, "part": t / 5} for t in ours]
    figures = camera.summary(times)
    assert figures["frame_vs_renderer"] == 3.0  # of 3, 4 and 2.5
    assert figures["ours.frame_ms"] == 20.0
    assert figures["ours.part_ms"] == 4.0
    assert figures["renderer.part_ms"] == 40.0


@pytest.mark.parametrize("flags", [{"frames": 0}, {"width": 0}, {"height": -1}])
def test_a_picture_of_nothing_is_refused(flags: dict[str, int]) -> None:
    with pytest.raises(InputError, match="at least 1"):
        camera.measure(CameraSettings(**flags))


def test_the_camera_is_measured_against_the_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "CONTENDERS", {name: camera.CONTENDERS[name] for name in ("ours", "renderer")})
    figures = camera.measure(CameraSettings(frames=1, width=64, height=48)).figures
    assert figures["frame_vs_renderer"] > 0
    parts = {name.split(".")[1] for name in figures if name.startswith("renderer.")}
    assert parts == {"frame_ms", "colour_ms", "depth_ms", "segmentation_ms"}
