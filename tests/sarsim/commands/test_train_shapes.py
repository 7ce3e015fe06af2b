"""The command that trains the classifier of extinguishers and levers, for two steps."""

from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.finds.shapes import ShapeReader
from sarsim.commands import train
from tests.pipeline.finds.wall_of_things import THINGS
from tests.sarsim.dataset.things_dataset import write_things_dataset

pytestmark = pytest.mark.training


def test_the_command_leaves_weights_that_the_robot_can_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "data", tmp_path / "shapes.safetensors"
    write_things_dataset(data, *THINGS)
    train.train_shapes(train.TrainShapes(data=(data,), out=out, steps=2, batch=4))
    printed = capsys.readouterr().out.replace("\n", "")
    assert str(out) in printed and "door_lever:" in printed
    assert ShapeReader.load(out)


def test_data_that_lack_a_kind_are_refused(tmp_path: Path) -> None:
    write_things_dataset(tmp_path / "data", "bottle")
    settings = train.TrainShapes(data=(tmp_path / "data",), out=tmp_path / "shapes.safetensors")
    with pytest.raises(InputError, match=r"data: .*door_lever"):
        train.train_shapes(settings)
