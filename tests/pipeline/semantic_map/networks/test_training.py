"""Training: it learns, resumes after an interruption, and refuses data from which it cannot learn."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.semantic_map.networks import training as training_module
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import NetworkClassifier, load_classifier
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.training import (
    WARMUP_FRACTION,
    Training,
    TrainingWorker,
    class_weights,
    cross_entropy,
    learning_rate_factor,
)
from pipeline.semantic_map.networks.training_config import BlockAugmentation, TrainingConfig
from tests.pipeline.polygon_scene import floor, look, pose, wall

pytestmark = pytest.mark.training

ALONE = TrainingWorker(0, 1, torch.device("cpu"))
CONFIG = TrainingConfig(steps=8, validate_every=4, batch=2)
BLOCKS = BlockConfig(size=0.5)
POSES = [pose(0.3 * i, 0.1 * i, 0.6, 0.5 * i, 0.25) for i in range(4)]
SCENE = [floor(-5, 5, -5, 5), wall((2, -5), (2, 5)), wall((-2, -5), (-2, 5)), wall((-5, 2), (5, 2))]


@pytest.fixture(scope="module")
def clouds():
    return [LabelledCloud.of(look(SCENE, eye), eye, 0.1) for eye in POSES]


def at(step):
    """A report that interrupts a training at a step."""

    def interrupt(training):
        if training.step == step:
            raise KeyboardInterrupt

    return interrupt


def trainer(clouds, out, config=CONFIG, initial="dgcnn"):
    return Training(clouds[:3], clouds[3:], config, initial, out, ALONE, BLOCKS, {"data": "walls"})


@pytest.fixture(scope="module")
def learned(clouds, tmp_path_factory) -> tuple[Training, Path]:
    """A training that went on until it had learned, and the weights that it left."""
    out = tmp_path_factory.mktemp("learned") / "w.safetensors"
    training = trainer(clouds, out, replace(CONFIG, steps=60, validate_every=30, batch=4))
    training.run()
    return training, out


@pytest.fixture(scope="module")
def finished(clouds, tmp_path_factory) -> Path:
    """The weights of a short training that nothing interrupted."""
    out = tmp_path_factory.mktemp("finished") / "w.safetensors"
    trainer(clouds, out).run()
    return out


def test_floor_and_walls_are_learned(learned: tuple[Training, Path]) -> None:
    training, out = learned
    assert training.score > 0.85
    assert NetworkClassifier(out)
    assert sorted(path.suffix for path in out.parent.iterdir()) == [".checkpoint", ".csv", ".safetensors"]
    header, *rows = out.with_suffix(".csv").read_text().splitlines()
    assert header.startswith("step,loss,miou_four,iou.wall")
    assert [row.split(",")[0] for row in rows] == ["30", "60"]


def test_interrupted_and_taken_up_again_it_leaves_the_same_weights(clouds, finished: Path, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        trainer(clouds, tmp_path / "left.safetensors").run(at(5))
    again = trainer(clouds, tmp_path / "left.safetensors")
    assert again.step == 5
    again.run()
    whole, left = (load_file(path) for path in (finished, tmp_path / "left.safetensors"))
    assert all((whole[name] == left[name]).all() for name in whole)
    assert finished.with_suffix(".csv").read_text() == (tmp_path / "left.csv").read_text()


def test_a_finished_training_writes_the_weights_again_if_they_are_missing(
    clouds, finished: Path, tmp_path: Path
) -> None:
    out = shutil.copytree(finished.parent, tmp_path / "copy") / finished.name
    before, table = load_file(out), out.with_suffix(".csv").read_text()
    out.unlink()
    trainer(clouds, out).run()
    after = load_file(out)
    assert all((before[name] == after[name]).all() for name in before)
    assert out.with_suffix(".csv").read_text() == table


def test_the_last_weights_are_kept_however_they_validate(clouds, tmp_path: Path, monkeypatch) -> None:
    out, found = tmp_path / "w.safetensors", iter([np.eye(6), 1 - np.eye(6)])
    monkeypatch.setattr(training_module, "confusion_matrix", lambda *given: next(found))
    training = trainer(clouds, out)
    training.run()
    assert [row[2] for row in training.rows] == [1.0, 0.0]
    with safe_open(out, "np") as file:
        about = json.loads(file.metadata()["training"])
    assert (about["step"], about["miou_four"]) == (CONFIG.steps, 0.0)


def test_weights_of_a_training_that_diverged_are_not_written(clouds, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    training = trainer(clouds, out)
    with torch.no_grad():
        next(training.network.parameters()).fill_(1e6)
    with pytest.raises(InputError, match="half precision"):
        training.run()
    assert not out.exists()


def test_a_training_may_begin_with_a_trained_network(clouds, learned: tuple[Training, Path], tmp_path: Path) -> None:
    losses = {}
    for name, initial in (("random", "dgcnn"), ("trained", load_classifier(learned[1])[0])):
        out = tmp_path / f"{name}.safetensors"
        training = trainer(clouds, out, initial=initial)
        with pytest.raises(KeyboardInterrupt):
            training.run(at(4))
        losses[name] = training.rows[0][1]
    assert losses["trained"] < losses["random"] / 2


@pytest.mark.parametrize("name", ["pointnet", "pointnext"])
def test_another_network_learns_and_goes_on_where_it_was_left(name: str, clouds, tmp_path: Path) -> None:
    config = replace(CONFIG, steps=8, validate_every=4)
    whole = trainer(clouds, tmp_path / "whole.safetensors", config, name)
    whole.run()
    assert whole.rows[1][1] < whole.rows[0][1]  # the loss
    with pytest.raises(KeyboardInterrupt):
        trainer(clouds, tmp_path / "left.safetensors", config, name).run(at(3))
    again = trainer(clouds, tmp_path / "left.safetensors", config, name)
    assert again.step == 3
    again.run()
    assert (tmp_path / "whole.csv").read_text() == (tmp_path / "left.csv").read_text()
    assert NetworkClassifier(tmp_path / "left.safetensors", network=name)


def test_processor_time_ends_a_training(clouds, tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    training = trainer(clouds, out, replace(CONFIG, steps=1000, minutes=1e-6))
    training.run()
    assert training.step == 1
    assert training.progress >= 1
    assert training.processor_time > 6e-5
    with safe_open(out, "np") as file:
        assert json.loads(file.metadata()["training"])["processor_s"] == pytest.approx(
            training.processor_time, abs=0.1
        )
    again = trainer(clouds, out, replace(CONFIG, steps=1000, minutes=1e-6))
    again.run()
    assert again.step == 1


def test_a_training_that_is_killed_keeps_its_checkpoints(clouds, tmp_path: Path, monkeypatch) -> None:
    kept = []
    path = tmp_path / "w.checkpoint"
    monkeypatch.setattr(training_module, "SAVE_EVERY", 3)
    trainer(clouds, tmp_path / "w.safetensors").run(lambda now: kept.append(path.exists()))
    assert kept[:4] == [False, False, True, True]


def test_a_checkpoint_of_other_settings_is_refused(clouds, tmp_path: Path) -> None:
    out, config = tmp_path / "w.safetensors", replace(CONFIG, steps=1)
    trainer(clouds, out, config).run()
    for other in ((clouds, out), (clouds[::-1], out, config), (clouds, out, config, "pointnext")):
        with pytest.raises(InputError, match=r"w\.checkpoint"):
            trainer(*other)


def test_a_checkpoint_of_other_initial_weights_is_refused(
    clouds, finished: Path, learned: tuple[Training, Path], tmp_path: Path
) -> None:
    out, config = tmp_path / "w.safetensors", replace(CONFIG, steps=1)
    trainer(clouds, out, config, load_classifier(finished)[0]).run()
    assert trainer(clouds, out, config, load_classifier(finished)[0]).step == 1
    for initial in ("dgcnn", load_classifier(learned[1])[0]):
        with pytest.raises(InputError, match=r"w\.checkpoint"):
            trainer(clouds, out, config, initial)


@pytest.mark.parametrize("content", [b"no checkpoint", torch.zeros(3), {"settings": 1}])
def test_another_file_in_a_checkpoints_place_is_refused(clouds, tmp_path: Path, content) -> None:
    path = tmp_path / "w.checkpoint"
    path.write_bytes(content) if isinstance(content, bytes) else torch.save(content, path)
    with pytest.raises(InputError, match=r"cannot be read as a training checkpoint|other settings"):
        trainer(clouds, tmp_path / "w.safetensors")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learning_rate": -1.0}, "--learning-rate -1: must be pos"),
        ({"learning_rate": float("nan")}, "--learning-rate nan: must be pos"),
        ({"seed": -1}, "--seed -1: must be non-neg"),
        ({"batch": 1}, "--batch 1: .*at least 2"),
        *(({"minutes": minutes}, "--minutes") for minutes in (0, float("nan"), float("inf"))),
    ],
)
def test_settings_that_no_training_can_have_are_refused(change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        TrainingConfig(**change)


@pytest.mark.parametrize(
    ("name", "wrong"), [("jitter", -0.1), ("jitter", float("inf")), ("rare", 1.1), ("dark", -0.1), ("thinnest", 2.0)]
)
def test_an_augmentation_that_no_training_can_have_is_refused(name: str, wrong: float) -> None:
    with pytest.raises(InputError, match=f"{name} = {wrong:g}: must be"):
        BlockAugmentation(**{name: wrong})


def test_nothing_to_learn_from_is_refused(clouds, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the training scenes contain no labelled points"):
        Training([], clouds, CONFIG, "dgcnn", tmp_path / "w", ALONE)
    with pytest.raises(InputError, match="the validation scenes contain no labelled points"):
        Training(clouds, [], CONFIG, "dgcnn", tmp_path / "w", ALONE)


def test_rare_classes_weigh_more(clouds) -> None:
    wall, terrain, *absent = class_weights(clouds).tolist()
    of_wall = np.mean(np.concatenate([cloud.classes for cloud in clouds]) == Label.WALL - 1)
    assert wall == pytest.approx(of_wall**-0.5)
    assert terrain == pytest.approx((1 - of_wall) ** -0.5)
    assert absent == [1, 1, 1, 1]


def test_cross_entropy_by_hand() -> None:
    logits = torch.log(torch.tensor([[0.5, 0.5], [0.9, 0.1]]))
    shares = torch.tensor([[1.0, 0.0], [0.25, 0.75]])
    expected = -(np.log(0.5) + 0.25 * np.log(0.9) + 2 * 0.75 * np.log(0.1)) / (1.25 + 2 * 0.75)
    assert float(cross_entropy(logits, shares, torch.tensor([1.0, 2.0]))) == pytest.approx(expected)


def test_the_learning_rate_rises_and_falls() -> None:
    rates = [learning_rate_factor(progress) for progress in np.linspace(0, 1, 101)]
    top = round(100 * WARMUP_FRACTION)
    assert max(rates) == rates[top] == 1
    assert rates[0] == 0
    assert rates[100] == pytest.approx(0)
    assert np.diff(rates[: top + 1]).min() > 0 > np.diff(rates[top:]).max()
