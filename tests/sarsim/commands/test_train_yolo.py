"""The command that trains YOLO, on a small dataset."""

import json
from pathlib import Path

import pytest
import torch

from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.weights import read_weights
from pipeline.victims.detection.yolo import YoloSmall
from sarsim.commands import train
from tests.refusal import refusal
from tests.sarsim.dataset.people_dataset import write_people_dataset

pytestmark = pytest.mark.training

QUICK = ["--width", 64, "--height", 32, "--steps", 2, "--batch", 1]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    write_people_dataset(folder)
    return folder


@pytest.fixture(scope="module")
def trained(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The weights that the command leaves."""
    out = tmp_path_factory.mktemp("trained") / "victims.weights"
    with pytest.MonkeyPatch.context() as patch:
        call(patch, "--data", data, "--out", out, *QUICK)
    return out


def call(monkeypatch: pytest.MonkeyPatch, *flags: object) -> None:
    monkeypatch.setattr("sys.argv", ["train.py", "yolo", *map(str, flags)])
    train.main()


def test_the_command_leaves_a_network_that_the_robot_can_use(data: Path, trained: Path) -> None:
    assert VictimDetector.load(trained.with_suffix(".cfg"), trained)
    card = json.loads(trained.with_suffix(".json").read_text())
    assert card["data"] == [str(data)]
    assert card["images"] == [16, 4]
    assert card["config"]["steps"] == 2
    assert trained.with_suffix(".csv").read_text().startswith("step,loss,ap50\n2,")


def test_a_training_can_begin_with_weights(
    data: Path, trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    second = tmp_path / "second.weights"
    still = ["--learning-rate", 1e-12]
    call(monkeypatch, "--data", data, "--out", second, *QUICK, *still, "--init", trained, "--steps", 1)
    assert str(second) in capsys.readouterr().out
    assert second.with_suffix(".cfg").read_text() == trained.with_suffix(".cfg").read_text()
    networks = [YoloSmall(), YoloSmall()]
    for path, network in zip((trained, second), networks, strict=True):
        read_weights(path, network)
    for one, other in zip(*(network.parameters() for network in networks), strict=True):
        torch.testing.assert_close(one, other, atol=1e-6, rtol=0)
    assert json.loads(second.with_suffix(".json").read_text())["init"] == str(trained)


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--data", "nowhere", "--out", "w.weights"], "nowhere"),
        (["--data", "DATA", "--out", "w.pt"], "end in .weights"),
        (["--data", "DATA", "--out", "nowhere/w.weights"], "nowhere"),
        (["--data", "DATA", "--out", "w.weights", "--init", "no.weights"], "no.weights"),
        (["--data", "DATA", "--out", "w.weights", "--init", __file__], "not a Darknet weights file"),
        (["--data", "DATA", "--out", "w.weights", "--width", "100"], "multiples of 32"),
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
    assert list(tmp_path.iterdir()) == []


def test_the_settings_that_it_leaves_can_be_changed_and_repeated(
    trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = trained.with_suffix(".yaml").read_text()
    assert "averaging: 0.998" in settings
    changed, second = tmp_path / "changed.yaml", tmp_path / "second.weights"
    changed.write_text(settings.replace("averaging: 0.998", "averaging: 0.5"))
    call(monkeypatch, "--config", changed, "--out", second)
    card = json.loads(second.with_suffix(".json").read_text())
    assert card["config"]["steps"] == 2
    assert card["config"]["optimization"]["averaging"] == 0.5
