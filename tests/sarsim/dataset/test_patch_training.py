"""Classifiers of small pictures: they go on where they were left, on the learning rate of PyTorch's one cycle."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch.optim.lr_scheduler import OneCycleLR

from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.training_loop import TrainingLoop
from sarsim.dataset.settings import OneCycle, ShapeTrainingConfig
from sarsim.dataset.shape_training import ShapeLearner, ShapePatches
from tests.pipeline.finds.wall_of_things import THINGS
from tests.sarsim.dataset.things_dataset import write_things_dataset


def test_a_training_that_was_left_ends_with_the_same_weights(tmp_path: Path) -> None:
    write_things_dataset(tmp_path / "data", *THINGS)
    config, worker = ShapeTrainingConfig(steps=6, batch=4), TrainingWorker.alone()
    known = ShapePatches([tmp_path / "data"], np.random.default_rng(0), config)

    def training(out: Path) -> TrainingLoop:
        return TrainingLoop(ShapeLearner(known, known, config, worker.device), config, out, worker)

    def leave(training: TrainingLoop) -> None:
        if training.step == 4:
            raise KeyboardInterrupt

    whole, left = tmp_path / "whole.safetensors", tmp_path / "left.safetensors"
    training(whole).run()
    with pytest.raises(KeyboardInterrupt):
        training(left).run(leave)
    torch.manual_seed(99)  # numbers that something else draws in between
    resumed = training(left)
    assert resumed.step == 4
    resumed.run()
    assert whole.read_bytes() == left.read_bytes()
    assert whole.with_suffix(".csv").read_text() == left.with_suffix(".csv").read_text()


@pytest.mark.parametrize("steps", [1, 2, 10, 97])
def test_one_cycle_is_pytorchs(steps: int) -> None:
    optimizer = torch.optim.AdamW([torch.zeros(1, requires_grad=True)], 2.0)
    theirs = OneCycleLR(optimizer, 2.0, steps)
    for step in range(1, steps + 1):
        (group,) = optimizer.param_groups
        assert 2 * OneCycle().rate(step / steps, steps) == pytest.approx(group["lr"])
        assert OneCycle().momentum(step / steps, steps) == pytest.approx(group["betas"][0])
        optimizer.step()
        if step < steps:
            theirs.step()
