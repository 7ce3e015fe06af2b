"""The command that trains, on a small dataset."""

import csv
import json
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from safetensors import safe_open

from pipeline.semantic_map.networks.classifier import NetworkClassifier
from sarsim.commands import train
from tests.refusal import refusal
from tests.sarsim.dataset.small import toys

pytestmark = pytest.mark.training


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "[b]all"
    toys(folder, 5)
    return folder


def call(monkeypatch: pytest.MonkeyPatch, *flags: object) -> None:
    monkeypatch.setattr("sys.argv", ["train.py", *map(str, flags)])
    train.main()


def test_the_command_leaves_weights_that_the_robot_can_use_and_prints_what_they_will_not_know(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "[b]w.safetensors"
    call(monkeypatch, "pointnext", "--data", dataset, dataset, "--out", out, "--steps", 2, "--batch", 2)
    printed = capsys.readouterr()
    assert str(out) in printed.out
    assert f"--data {dataset} {dataset}: the train split has no points labelled " in printed.err.replace("\n", " ")
    assert "ceiling" in printed.err
    assert NetworkClassifier(out, network="pointnext")
    with safe_open(out, "np") as file:
        training = json.loads(file.metadata()["training"])
    assert training["data"] == [str(dataset)] * 2
    assert training["scenes"] == 10
    assert training["config"]["steps"] == 2
    other = ["pointnet", "--data", dataset, "--out", tmp_path / "v.safetensors", "--init", out]
    assert "pointnext" in refusal(capsys, call, monkeypatch, *other)


def test_colours_make_nine_channels_and_go_on_with_them(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tmp_path / "first.safetensors", tmp_path / "second.safetensors"
    flags = ["--data", dataset, "--steps", 1, "--batch", 2]
    call(monkeypatch, "pointnext", *flags, "--out", first, "--colours")
    call(monkeypatch, "pointnext", *flags, "--out", second, "--init", first)
    for path in (first, second):
        with safe_open(path, "np") as file:
            assert file.metadata()["channels"] == "9"


PAIR = """
import os
import torch._dynamo
from pipeline.semantic_map.networks import classifier, training
from sarsim.commands import train
from sarsim.dataset import manifest
os.environ["RANK"] = "0" if os.fork() else "1"
train.main()
if os.environ["RANK"] == "0":
    assert os.wait()[1] == 0
"""
"""Two processes with what torchrun tells its own; the imports, which take longest, are done once."""


def test_two_processes_train_together_and_end_together_when_the_time_is_up(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    group = {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    flags = ["pointnext", "--data", dataset, "--out", out, "--steps", 400, "--minutes", 0.01, "--batch", 2]
    command = [sys.executable, "-c", PAIR, *map(str, flags)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=os.environ | group)
    assert done.returncode == 0, done.stderr
    assert NetworkClassifier(out, network="pointnext")


def test_a_missing_scene_is_noticed_before_any_is_read(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = shutil.copytree(dataset, tmp_path / "data")
    (copy / "scenes" / "00003.h5").unlink()
    (copy / "scenes" / "00000.h5").write_bytes(b"")
    flags = ["dgcnn", "--data", copy, "--out", tmp_path / "w.safetensors"]
    assert "00003.h5" in refusal(capsys, call, monkeypatch, *flags)


def test_a_dataset_without_scenes_to_learn_from_is_refused(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = shutil.copytree(dataset, tmp_path / "data")
    content = json.loads((copy / "dataset.json").read_text())
    content["scenes"] = [scene for scene in content["scenes"] if scene["split"] == "val"]
    (copy / "dataset.json").write_text(json.dumps(content))
    with pytest.raises(SystemExit) as raised:
        call(monkeypatch, "dgcnn", "--data", copy, "--out", tmp_path / "w.safetensors")
    assert raised.value.code == 2
    assert "the train split has no scenes; generate at least 5 scenes" in capsys.readouterr().err


def test_tensorboard_reads_the_validations(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reader = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    flags = ["--steps", 2, "--batch", 2, "--validate-every", 1, "--tensorboard", tmp_path / "events"]
    call(monkeypatch, "pointnext", "--data", dataset, "--out", tmp_path / "w.safetensors", *flags)
    events = reader.EventAccumulator(str(tmp_path / "events")).Reload()
    with (tmp_path / "w.csv").open() as table:
        header, *rows = csv.reader(table)
    assert set(header[1:]) == set(events.Tags()["scalars"])
    assert [event.step for event in events.Scalars("loss")] == [int(row[0]) for row in rows] == [1, 2]
    assert [event.value for event in events.Scalars("loss")] == pytest.approx([float(row[1]) for row in rows])


def test_events_need_tensorboard(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    flags = ["--data", dataset, "--out", tmp_path / "w.safetensors", "--tensorboard", tmp_path]
    with pytest.raises(SystemExit) as raised:
        call(monkeypatch, "pointnet", *flags)
    assert raised.value.code == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "--tensorboard" in line]
    assert "pip install tensorboard" in line
