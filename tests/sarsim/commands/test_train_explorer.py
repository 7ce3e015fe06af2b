"""The command that trains an explorer of 2D maps, for two updates."""

import sys
from pathlib import Path

import pytest
import torch

import sarsim.tasks
from pipeline.errors import InputError
from sarsim.commands.train import TrainExplorer, train_explorer
from sarsim.tasks.viewpoint_network import ViewpointNetwork

pytestmark = pytest.mark.training


def test_the_command_leaves_weights_that_follow_the_seed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    learned = []
    for n, seed in enumerate((0, 0, 1)):
        out = tmp_path / f"{n}.safetensors"
        train_explorer(TrainExplorer(out=out, steps=16, worlds=2, horizon=4, seed=seed))
        assert str(out) in capsys.readouterr().out.replace("\n", "")
        learned.append(ViewpointNetwork.load(out).state_dict()["beside.2.weight"])
    assert torch.equal(learned[0], learned[1]) and not torch.equal(learned[0], learned[2])


def test_what_is_wrong_is_said_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"explorer\.pth: .*\.safetensors"):
        train_explorer(TrainExplorer(out=tmp_path / "explorer.pth"))
    monkeypatch.delitem(sys.modules, "sarsim.tasks.ppo", raising=False)
    monkeypatch.delattr(sarsim.tasks, "ppo", raising=False)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(InputError, match=r"pip install .*rl"):
        train_explorer(TrainExplorer(out=tmp_path / "explorer.safetensors"))
