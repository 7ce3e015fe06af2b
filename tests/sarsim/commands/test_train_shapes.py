"""The command that trains the classifier of extinguishers and levers, for two steps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.finds.shapes import ShapeReader
from sarsim.commands import train
from sarsim.dataset.manifest import Manifest, SceneEntry, scene_path, split_of
from sarsim.dataset.scene_file import SceneFrame, SceneWriter
from tests.pipeline.finds.wall_of_things import THINGS, wall_of
from tests.sarsim.dataset.small import RECIPE, content


def write_dataset(folder: Path, *things: str) -> None:
    """A dataset of one frame that shows these things and a block."""
    frame, geoms = wall_of(*things)
    count = len(geoms)
    about = replace(
        content(0), intrinsics=frame.intrinsics, geom_name=geoms, geom_label=np.full(count, 7, np.uint8),
        geom_victim=np.full(count, -1, np.int16),
    )  # fmt: skip
    (folder / "scenes").mkdir(parents=True)
    with SceneWriter(folder / scene_path(0), 1, about) as writer:
        writer.write(SceneFrame(frame, np.eye(4), np.zeros((0, 4), np.int32), np.zeros(0, np.int32)))
    manifest = Manifest.new(RECIPE)
    manifest.scenes[0] = SceneEntry(0, scene_path(0), split_of(0), "", 1, "toy", "dim", {})
    manifest.write(folder)


def test_the_command_leaves_weights_that_the_robot_can_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "data", tmp_path / "shapes.safetensors"
    write_dataset(data, *THINGS)
    train.train_shapes(train.TrainShapes(data=(data,), out=out, steps=2, batch=4))
    told = capsys.readouterr().out.replace("\n", "")
    assert str(out) in told and "door_lever: told as" in told
    assert ShapeReader.load(out)


def test_data_that_lack_a_kind_are_refused(tmp_path: Path) -> None:
    write_dataset(tmp_path / "data", "bottle")
    settings = train.TrainShapes(data=(tmp_path / "data",), out=tmp_path / "shapes.safetensors")
    with pytest.raises(InputError, match="data: shows no door_lever"):
        train.train_shapes(settings)
