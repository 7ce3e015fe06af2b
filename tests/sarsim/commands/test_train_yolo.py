"""The command that trains YOLO, on a small dataset."""

import json
from pathlib import Path

import pytest
import torch

from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.weights import load_network
from sarsim.assets import asset
from sarsim.commands import train
from tests.refusal import refusal
from tests.sarsim.dataset.people_dataset import write_people_dataset

pytestmark = pytest.mark.training

COCO = str(asset("weights", "yolov3-tiny.cfg").with_suffix(".weights"))
QUICK = ["--width", 64, "--height", 32, "--network", "yolov3-tiny", "--steps", 2, "--batch", 1]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    write_people_dataset(folder)
    return folder


def call(monkeypatch: pytest.MonkeyPatch, *flags: object) -> None:
    monkeypatch.setattr("sys.argv", ["train.py", "yolo", *map(str, flags)])
    train.main()


def test_the_command_leaves_a_network_that_the_robot_can_use(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "victims.weights"
    call(monkeypatch, "--data", data, "--out", out, *QUICK)
    assert str(out) in capsys.readouterr().out
    assert VictimDetector.load(out.with_suffix(".cfg"), out)
    card = json.loads(out.with_suffix(".json").read_text())
    assert card["data"] == [str(data)]
    assert card["images"] == [16, 4]
    assert card["config"]["steps"] == 2
    assert out.with_suffix(".csv").read_text().startswith("step,loss,ap50\n2,")


def test_a_training_can_begin_with_weights(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = tmp_path / "first.weights", tmp_path / "second.weights"
    call(monkeypatch, "--data", data, "--out", first, *QUICK)
    still = ["--learning-rate", 1e-12]
    call(monkeypatch, "--data", data, "--out", second, *still, "--init", first, "--width", 96, "--steps", 1)
    assert second.with_suffix(".cfg").read_text() == first.with_suffix(".cfg").read_text()
    networks = [load_network(path.with_suffix(".cfg"), path) for path in (first, second)]
    for one, other in zip(*(network.parameters() for network in networks), strict=True):
        torch.testing.assert_close(one, other, atol=1e-6, rtol=0)
    assert json.loads(second.with_suffix(".json").read_text())["init"] == str(first)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--data", "nowhere", "--out", "w.weights"], "nowhere"),
        (["--data", "DATA", "--out", "w.pt"], "ends with .weights"),
        (["--data", "DATA", "--out", "nowhere/w.weights"], "there is no folder"),
        (["--data", "DATA", "--out", "w.weights", "--stride", "0"], "--stride"),
        (["--data", "DATA", "--out", "w.weights", "--init", "no.weights"], "no.cfg: No such file"),
        (["--data", "DATA", "--out", "w.weights", "--init", COCO], "80 classes"),
        (["--data", "DATA", "--out", "w.weights", "--width", "100"], "multiples of 32"),
        (["--data", "DATA", "--out", "w.weights", "--network", "yolov3"], "too few to fit 9 anchors"),
    ],
)
def test_what_cannot_work_is_status_2_and_one_line(
    flags: list[str],
    complaint: str,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    flags = [data if flag == "DATA" else flag for flag in flags]
    assert complaint in refusal(capsys, call, monkeypatch, *flags)
    assert list(tmp_path.iterdir()) == [data]


def test_the_settings_that_it_leaves_can_be_changed_and_repeated(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tmp_path / "first.weights", tmp_path / "second.weights"
    call(monkeypatch, "--data", data, "--out", first, *QUICK)
    settings = first.with_suffix(".yaml").read_text()
    assert "averaging: 0.998" in settings
    first.with_suffix(".yaml").write_text(settings.replace("averaging: 0.998", "averaging: 0.5"))
    call(monkeypatch, "--config", first.with_suffix(".yaml"), "--out", second)
    card = json.loads(second.with_suffix(".json").read_text())
    assert card["config"]["optimization"]["averaging"] == 0.5
    assert card["config"]["optimization"]["most_gradient"] == 10
