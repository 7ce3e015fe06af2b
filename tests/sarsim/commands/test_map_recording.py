"""map_recording.py: the files that it writes for whole and broken recordings."""

import json
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.league.brief import HANDED_IN
from pipeline.league.validation import validate
from pipeline.metric_map.io.npz import load_metric_map
from sarsim.commands.map_recording import MapRecording, map_recording
from sarsim.commands.settings import run_with_settings
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.generate import generate
from sarsim.dataset.recipe import Recipe
from scripts.benchmarks.localisation_scores import evo_ate
from tests.pipeline.datasets.recorded_room import frames, write_bag
from tests.pipeline.rescue_report.html_page import read
from tests.refusal import refusal
from tests.sarsim.dataset.small import InProcess

FILES = {
    "config.yaml", "episode.rrd", "finds.json", "keyframes.npz", "metric_map.npz", "report.html", "report.json",
    "semantic_map.ply", "topology.json", "trajectory_estimated.tum", "trajectory_true.tum", "victims.csv",
    "victims.json",
}  # fmt: skip


def run(*words: object) -> None:
    run_with_settings(map_recording, MapRecording, [*map(str, words), "--detector", "None"])


def failed(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The line that a command ends with, whose status is 2."""
    with pytest.raises(SystemExit) as raised:
        run(*words)
    assert raised.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    run(write_bag(folder / "room"), "--out", folder / "out", "--labels", "truth", "--mission", "league")
    return folder / "out"


def test_it_leaves_the_files_of_an_episode(mapped: Path) -> None:
    assert {path.name for path in mapped.iterdir()} == FILES | {HANDED_IN}
    assert validate(mapped) == []
    report = json.loads((mapped / "report.json").read_text())
    assert report["recording"]["frames"] == len(frames())
    assert report["recording"]["left_out"] == {}
    assert report["localisation"]["keyframes"] == report["recording"]["keyframes"] > report["steps"] > 0
    assert len(load_metric_map(mapped / "metric_map.npz").occupied_centres()) > 500
    page = read((mapped / "report.html").read_text())
    assert "room" in page.text
    assert not [tile.text for tile in page.all("div", "tile") if "good" in tile.attributes["class"]]


def test_the_error_is_evos(mapped: Path) -> None:
    report = json.loads((mapped / "report.json").read_text())
    ate = evo_ate(mapped / "trajectory_true.tum", mapped / "trajectory_estimated.tum")
    assert report["localisation"]["ate_rmse_m"] == pytest.approx(ate, abs=2e-6)
    assert 0 < ate < 0.015


def test_what_came_before_a_broken_image_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def broken(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if topic == "/camera/depth/image_raw" and time > 0.75:
            message.data = message.data[:1000]
        yield topic, time, message

    path, out = write_bag(tmp_path / "room", change=broken), tmp_path / "out"
    line = failed(capsys, path, "--out", out, "--labels", "truth", "--poses", "registration")
    assert line.startswith("error: ") and "an image is cut short" in line
    assert {path.name for path in out.iterdir()} == FILES
    report = json.loads((out / "report.json").read_text())
    assert report["recording"]["frames"] == 8
    assert "an image is cut short" in report["recording"]["stopped"]


def test_a_recording_of_nothing_leaves_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def blank(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        is_depth = topic == "/camera/depth/image_raw"
        return [(topic, time, replace(message, data=np.zeros_like(message.data)) if is_depth else message)]

    path, out = write_bag(tmp_path / "room", change=blank), tmp_path / "out"
    assert "frame" in failed(capsys, path, "--out", out, "--labels", "truth")
    assert not out.exists()


def test_gaps_cost_no_more_than_the_frames_in_them(tmp_path: Path) -> None:
    def gappy(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        blind = topic.startswith("/camera/depth/image") and 0.15 < time < 0.45
        lost = topic in ("/odom", "/tf") and 0.55 < time < 1.15
        return [] if blind or lost else [(topic, time, message)]

    run(write_bag(tmp_path / "room", change=gappy), "--out", tmp_path / "out", "--labels", "truth")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["recording"]["left_out"] == {"frames at times of which no pose is known": 6}
    assert report["recording"]["frames"] == len(frames()) - 3 - 6
    assert report["localisation"]["ate_rmse_m"] < 0.03


def test_a_scene_and_its_tum_folder_make_one_map(tmp_path: Path) -> None:
    recipe = Recipe(seed=3, frames=4, width=160, height=120, arenas=("nist_6x4",))
    generate(recipe, 1, tmp_path / "data", InProcess())
    list(Tum(tmp_path / "data", tmp_path / "tum").run())
    (scene,) = (tmp_path / "data" / "scenes").glob("*.h5")
    run(scene, "--out", tmp_path / "a", "--labels", "truth", "--poses", "truth")
    # The folder does not say where the camera is on the robot: it hangs 0.6 m above the ground at (0, 0).
    run(tmp_path / "tum" / "arena_0", "--out", tmp_path / "b", "--poses", "truth")
    a, b = (load_metric_map(tmp_path / name / "metric_map.npz").occupied_centres() for name in "ab")
    same = set(map(tuple, np.round(a, 3).tolist())) & set(map(tuple, np.round(b, 3).tolist()))
    assert len(same) >= 0.98 * max(len(a), len(b)) > 100


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere"], "error: nowhere: no such file or folder"),
        (["."], "no recording: it has neither depth.txt nor images in depth/"),
        ([".", "--intrinsics", "1", "1", "0", "1"], "--intrinsics 1.0 1.0 0.0 1.0: must be positive"),
        ([".", "--fps", "0"], "--fps 0.0: must be positive"),
        ([".", "--poses", "guess"], "--poses"),
    ],
)
def test_bad_flags_are_one_line(
    words: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in failed(capsys, *words, "--out", "out")
    assert not (tmp_path / "out").exists()


def test_a_pipe_is_no_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe")
    line = refusal(capsys, run, tmp_path / "pipe", "--out", tmp_path / "out")
    assert line.startswith(f"error: {tmp_path / 'pipe'}: ")
    assert not (tmp_path / "out").exists()
