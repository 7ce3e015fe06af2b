"""The command that trains the classifier of hazmat signs, for two steps."""

from pathlib import Path

import pytest

from pipeline.finds.hazmat import HazmatReader
from sarsim.commands import train
from tests.sarsim.dataset.people_dataset import write_people_dataset

pytestmark = pytest.mark.training


def test_the_command_leaves_weights_that_the_robot_can_use(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "data", tmp_path / "hazmat.safetensors"
    data.mkdir()
    write_people_dataset(data)
    few = {"steps": 2, "bank": 8, "labels": 1, "batch": 4, "processes": 2, "validated": 5}
    train.train_hazmat(train.TrainHazmat(data=(data,), out=out, **few))
    assert str(out) in capsys.readouterr().out.replace("\n", "")
    assert HazmatReader.load(out)
