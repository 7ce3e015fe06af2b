from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from pipeline.errors import InputError
from sarsim.tasks.viewpoint_network import ViewpointNetwork


def viewpoints(count: int) -> torch.Tensor:
    rows = torch.from_numpy(np.random.default_rng(0).uniform(0.1, 1, (1, 8, 4)).astype(np.float32))
    rows[:, count:] = 0
    return rows


def test_the_order_of_viewpoints_says_nothing() -> None:
    network, rows, order = ViewpointNetwork(), viewpoints(8), torch.randperm(8)
    logits, of_all = network(rows)
    again, same = network(rows[:, order])
    assert torch.allclose(again, logits[:, order], atol=1e-5) and torch.allclose(same, of_all, atol=1e-5)


def test_rows_without_a_viewpoint_are_not_chosen_and_change_nothing() -> None:
    network, rows = ViewpointNetwork(), viewpoints(5)
    logits, of_all = network(rows)
    fewer, same = network(rows[:, :5])
    assert torch.allclose(logits[:, :5], fewer, atol=1e-5) and torch.allclose(of_all, same, atol=1e-5)
    assert logits.softmax(1)[0, 5:].eq(0).all()
    assert network.choice(rows[0].numpy()) == int(fewer.argmax())


def test_weights_come_back_and_those_of_another_network_are_refused(tmp_path: Path) -> None:
    network, path = ViewpointNetwork(), tmp_path / "explorer.safetensors"
    save_file(network.state_dict(), path)
    assert torch.equal(ViewpointNetwork.load(path)(viewpoints(8))[0], network(viewpoints(8))[0])
    save_file({"foreign": torch.zeros(1)}, path)
    for wrong in (path, tmp_path / "missing.safetensors"):
        with pytest.raises(InputError, match=f"^{wrong}: .*$"):
            ViewpointNetwork.load(wrong)
