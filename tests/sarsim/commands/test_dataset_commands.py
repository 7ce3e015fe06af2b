"""generate_dataset.py and export_dataset.py: flags, exit statuses, what they say."""

import sys
from pathlib import Path

import h5py
import pytest

from sarsim.commands import export_dataset, generate_dataset
from sarsim.commands.generate_dataset import GenerateDatasetConfig
from sarsim.commands.generate_dataset import generate_dataset as command
from sarsim.commands.settings import run_with_settings
from tests.refusal import refusal
from tests.sarsim.dataset.small import InProcess, toys


def test_the_command_says_where_the_dataset_lies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generate_dataset, "make_engine", lambda *flags: InProcess(toys=True))
    run_with_settings(command, GenerateDatasetConfig, ["--out", str(tmp_path / "[b]data"), "--scenes", "2"])
    captured = capsys.readouterr()
    assert f"2 scenes in {tmp_path / '[b]data'}" in captured.out
    assert (tmp_path / "[b]data" / "index.html").exists()


@pytest.mark.parametrize("name", sorted(export_dataset.EXPORTS))
def test_every_export_is_a_subcommand(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    toys(tmp_path / "data", 2)
    out = tmp_path / "[b]out"
    args = ["export_dataset.py", name, "--data", str(tmp_path / "data"), "--out", str(out)]
    monkeypatch.setattr(sys, "argv", args)
    export_dataset.main()
    assert f"Exported 2 scenes to {out}" in capsys.readouterr().out
    assert list(out.rglob("*"))


def test_colours_are_of_blocks_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    toys(tmp_path / "data", 1)
    flags = ["--colours", "--data", str(tmp_path / "data"), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", ["export_dataset.py", "s3dis", *flags])
    assert "--colours" in refusal(capsys, export_dataset.main)
    monkeypatch.setattr(sys, "argv", ["export_dataset.py", "blocks", *flags])
    export_dataset.main()
    with h5py.File(tmp_path / "out" / "ply_data_all_0.h5") as file:
        assert file["data"].shape[1:] == (4096, 9)
