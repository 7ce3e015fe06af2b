"""The command that trains YOLO, on a small dataset."""

import json
from pathlib import Path

import pytest

from pipeline.victim_detection.detector import VictimDetector
from sarsim.scripts import train
from tests.sarsim.dataset.people_dataset import write_people_dataset

QUICK = ["--width", 64, "--height", 32, "--network", "yolov3-tiny", "--steps", 2, "--sampling.batch", 1]


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


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--data", "nowhere", "--out", "w.weights"], "nowhere"),
        (["--data", "DATA", "--out", "w.pt"], "ends with .weights"),
        (["--data", "DATA", "--out", "nowhere/w.weights"], "there is no folder"),
        (["--data", "DATA", "--out", "w.weights", "--stride", "0"], "--stride"),
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
    with pytest.raises(SystemExit) as raised:
        call(monkeypatch, *[data if flag == "DATA" else flag for flag in flags])
    assert raised.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert complaint in line
    assert list(tmp_path.iterdir()) == [data]
