"""The file that a benchmark writes, what it refuses, and a small run of the subject "camera"."""

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from pipeline.errors import InputError
from scripts import benchmark
from scripts.benchmarks import camera
from scripts.benchmarks.common import Result
from scripts.benchmarks.settings import CameraSettings, SubjectSettings
from tests.refusal import refusal


@dataclass(frozen=True, kw_only=True)
class Toy(SubjectSettings):
    raf: Path
    seed: int = 0


def test_the_file_says_what_was_measured_where_and_how(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    toy = SimpleNamespace(measure=lambda settings: Result({"toy_vs_peer": 2.5}, {"rounds": [1, 2]}, ["[b]failed"]))
    monkeypatch.setattr(benchmark, "import_module", lambda name: toy)
    file = tmp_path / "toy.json"
    benchmark.benchmark(Toy(json=file, raf=tmp_path, seed=5), "camera")
    content = json.loads(file.read_text())
    assert content.keys() == {"subject", "version", "machine", "config", "figures", "rounds"}
    assert content["subject"] == "camera" and content["machine"]["packages"]["mujoco"]
    assert content["config"] == {"raf": str(tmp_path), "seed": 5}
    assert content["figures"] == {"toy_vs_peer": 2.5}
    assert yaml.safe_load((tmp_path / "toy.yaml").read_text())["seed"] == 5
    printed = capsys.readouterr().out
    assert "toy_vs_peer" in printed and "[b]failed" in printed
    with pytest.raises(InputError, match=r"--json .*nowhere/toy.json"):
        benchmark.benchmark(Toy(json=tmp_path / "nowhere" / "toy.json", raf=tmp_path), "camera")


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["coffee"], "unknown subcommand 'coffee': must be one of barn, camera, "),
        (["camra"], "; perhaps you meant camera"),
        (["camera", "--raf", "folder"], "--raf"),
        (["camera", "--frames", "0"], "--frames 0: must be at least 1"),
        (["correction", "--seed", "-1"], "--seed -1"),
        (["dataset", "--rounds", "0"], "--rounds 0"),
        (["cost", "--arenas"], "--arenas"),
        (["lidar", "--arenas"], "--arenas"),
        (["lidar", "--rounds", "0"], "--rounds 0"),
        (["metric-map", "--frames", "0"], "--frames 0"),
        (["planning", "--steps", "0"], "--steps 0"),
        (["victims", "--detector", "None"], "--detector"),
        (["victims", "--detector", "a.cfg", "b"], "a.cfg: "),
        (["exploration", "--workers", "0"], "--workers 0"),
        (["exploration", "--arenas"], "--arenas"),
        (["exploration", "--labels", "dgcnn", "--weights", "/nowhere.safetensors"], "/nowhere"),
        (["localisation", "--arenas", "."], "contains no .raf files"),
        (["networks", "--weights", "/no"], "--weights /no"),
        (["finds", "--photos", "."], "truth.json"),
        (["barn", "--worlds", "/no"], "--worlds /no"),
        (["barn", "--robot", "none.xml"], "--robot none.xml"),
        (["worlds", "--worlds", "/no"], "--worlds /no"),
        (["lanes", "--lanes", "moat"], "--lanes moat"),
    ],
)
def test_what_cannot_be_measured_is_status_2(
    flags: list[str],
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["benchmark.py", *flags])
    assert complaint in refusal(capsys, benchmark.main)
    assert not list(tmp_path.rglob("*.json"))


def test_the_camera_is_measured_against_the_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "CONTENDERS", {name: camera.CONTENDERS[name] for name in ("ours", "renderer")})
    monkeypatch.setattr(camera, "IMAGE_SIZE", (64, 48))
    figures = camera.measure(CameraSettings(frames=1)).figures
    assert figures["frame_vs_renderer"] > 0
    parts = {name.split(".")[1] for name in figures if name.startswith("renderer.")}
    assert parts == {"frame_ms", "colour_ms", "depth_ms", "segmentation_ms"}
