"""Whole datasets: every engine makes the same bytes, and nothing is lost, whichever process dies."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from sarsim import jobs
from sarsim.commands import generate_dataset
from sarsim.commands.generate_dataset import GenerateDatasetConfig
from sarsim.commands.settings import run_with_settings
from sarsim.dataset.generate import generate
from sarsim.dataset.manifest import Manifest, scene_path
from sarsim.jobs import locked
from tests.sarsim.dataset.small import RECIPE, InProcess, files, toys
from tests.source_tree import ROOT

SCENES = 3
FLAGS = f"--scenes {SCENES} --frames 3 --width 64 --height 48 --seed 3 --workers 2 --arenas nist_6x4".split()
"""They make a dataset of so many scenes by the recipe."""


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of an undisturbed run in this process alone."""
    folder, seen = tmp_path_factory.mktemp("reference") / "data", list[int]()
    generate(RECIPE, SCENES, folder, InProcess(), seen.append)
    assert seen == [RECIPE.frames * scenes for scenes in range(SCENES + 1)]
    return files(folder)


def test_a_command_that_is_interrupted_is_completed_by_the_next(
    tmp_path: Path, reference: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "data"
    script = [sys.executable, ROOT / "scripts" / "generate_dataset.py", "--out", folder, *FLAGS]
    process = subprocess.Popen(script, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    while not list(folder.glob("scenes/*.h5")) and process.poll() is None:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    # It is free as soon as the last worker has ended.
    with locked(folder):
        whole = {f"scenes/{path.name}": path.read_bytes() for path in folder.glob("scenes/*.h5")}
    assert whole
    assert all(data == reference[name] for name, data in whole.items())
    monkeypatch.setattr(generate_dataset, "make_engine", lambda *flags: InProcess())
    run_with_settings(generate_dataset.generate_dataset, GenerateDatasetConfig, ["--out", str(folder), *FLAGS])
    assert files(folder) == reference
    assert set(reference) == {"dataset.json", "index.html", "croissant.json", *(scene_path(k) for k in range(SCENES))}


def test_what_goes_wrong_in_a_scene_is_reported(tmp_path: Path) -> None:
    recipe = replace(RECIPE, arenas=(str(tmp_path / "missing.xml"),))
    with pytest.raises(InputError, match=r"scene 0: .*missing\.xml"):
        generate(recipe, 1, tmp_path / "data", InProcess())
    assert set(files(tmp_path / "data")) == {"dataset.json"}


def test_whole_scenes_are_kept_and_changed_ones_made_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "data"
    assert toys(folder) == [0, 1, 2]
    before = files(folder)
    assert toys(folder) == []
    (folder / scene_path(1)).write_bytes(b"broken")
    (folder / scene_path(2)).unlink()
    assert toys(folder) == [1, 2]
    assert files(folder) == before
    assert "00001.h5" in caplog.text
    manifest = Manifest.read(folder)
    del manifest.scenes[2]
    manifest.write(folder)
    assert toys(folder) == [2]
    assert files(folder) == before


def test_a_dataset_grows_and_keeps_its_splits(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    toys(folder, 2)
    assert toys(folder, 10) == list(range(2, 10))
    assert toys(folder, 1) == []
    splits = [entry.split for entry in Manifest.read(folder).scenes.values()]
    assert splits == ["train"] * 4 + ["val"] + ["train"] * 4 + ["test"]


def test_leftovers_are_removed(tmp_path: Path) -> None:
    toys(tmp_path / "data", 1)
    (tmp_path / "data" / "scenes" / "00000.h5").unlink()
    (tmp_path / "data" / "scenes" / "00000.h5.part").write_bytes(b"half")
    toys(tmp_path / "data", 1)
    assert not list((tmp_path / "data").rglob("*.part"))


def test_another_recipe_needs_another_folder(tmp_path: Path) -> None:
    toys(tmp_path / "data")
    with pytest.raises(InputError, match=r"frames = 3, not 5"):
        toys(tmp_path / "data", recipe=replace(RECIPE, frames=5))


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(InputError, match=r"thesis\.txt .*dataset\.json"):
        toys(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
    with pytest.raises(InputError, match=r"thesis.txt: "):
        toys(tmp_path / "thesis.txt")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "JSON"),
        ("[]", "not the dataset.json of a dataset"),
        ('{"format": "sarsim-dataset", "version": 9}', "format version 9; .* reads only version 1"),
        ("[" * 100_000, "JSON"),
        ('{"format": "sarsim-dataset", "version": 1}', "damaged: the key 'scenes' is missing"),
        ('{"format": "sarsim-dataset", "version": 1, "scenes": [], "recipe": []}', "damaged: "),
        ({"generator": "sarsim 0.0.1"}, r"0\.0\.1"),
        ({"split": "/tmp"}, "the split of scene 1 is '/tmp'"),
        ({"file": "/dev/zero"}, "'/dev/zero'"),
        ({"index": "../1"}, r"index .*'\.\./1'"),
        ({"index": 1e300}, r"1e\+300"),
        ({"frames": "3"}, "frames of scene 1 .*'3'"),
        ({"points": {"wall": "many"}}, "points of scene 1"),
        ({"arena": 3}, "arena of scene 1"),
    ],
)
def test_a_manifest_that_is_none_or_a_strangers_is_refused(
    tmp_path: Path, text: str | dict[str, Any], message: str
) -> None:
    toys(tmp_path, 2)
    path = tmp_path / "dataset.json"
    if not isinstance(text, str):
        content = json.loads(path.read_text())
        (content if "generator" in text else content["scenes"][1]).update(text)
        text = json.dumps(content)
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        toys(tmp_path)


def test_one_generator_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    toys(tmp_path)
    monkeypatch.setattr(jobs, "LOCK_TIMEOUT", 0.1)
    with locked(tmp_path), pytest.raises(InputError, match=tmp_path.name):
        toys(tmp_path)


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/data"):
        toys(tmp_path / "file" / "data")
