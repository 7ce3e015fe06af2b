"""Training: the loss, and that a small network learns to find white boxes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.special import logit

from pipeline.errors import InputError
from pipeline.semantic_map.networks.parallel import TrainingWorker
from pipeline.semantic_map.networks.training_loop import TrainingLoop
from pipeline.victims.detection import loss
from pipeline.victims.detection.boxes import overlaps
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.labelled_image import TrainingImage
from pipeline.victims.detection.loss import YoloLoss, ciou, iou
from pipeline.victims.detection.training import YoloLearner, new_network, scaled_anchors, validate
from pipeline.victims.detection.training_config import CanvasAugmentation, YoloOptimization, YoloTrainingConfig
from pipeline.victims.detection.yolo import Grid, YoloSmall
from tests.pipeline.victims.constants import constants
from tests.pipeline.victims.detection.people import WhiteBoxes

pytestmark = pytest.mark.training

CFG = Path(__file__).parents[4] / "assets" / "weights" / "yolov3-small.cfg"
ONE = (Grid(((4.0, 6.0),), (0,)),)
"""One anchor in 8 × 4 cells of an input of 16 × 8 pixels."""
CONFIG = YoloTrainingConfig(width=64, height=64, steps=6, validate_every=3, batch=2)


def trainer(
    out: Path, config: YoloTrainingConfig = CONFIG, images: int = 30, validated: int = 6
) -> TrainingLoop[list[TrainingImage], YoloSmall]:
    """A training on images with white boxes."""
    worker = TrainingWorker.alone()
    learner = YoloLearner(WhiteBoxes(images), WhiteBoxes(validated, 1), config, CFG, None, worker.device)
    return TrainingLoop(learner, config, out, worker)


def labelled(*boxes: Sequence[float], ignored: bool = False) -> TrainingImage:
    rows = np.array(boxes, np.float32).reshape(-1, 4)
    return TrainingImage(np.zeros((8, 16, 3), np.uint8), rows, np.full(len(rows), ignored))


def head(objectness: float) -> torch.Tensor:
    """The only head of ONE, of 4 × 8 cells, with that logit everywhere."""
    result = torch.zeros(1, 6, 4, 8)
    result[:, 4] = objectness
    return result


def test_the_loss_of_an_empty_image_is_the_cross_entropy_of_every_cell() -> None:
    loss_of = YoloLoss(ONE, (16, 8))
    assert float(loss_of([head(logit(0.25))], [labelled()])) == pytest.approx(-32 * np.log(0.75), rel=1e-5)


def test_a_perfect_answer_costs_nothing() -> None:
    answer = head(-30)
    answer[0, 4, 1, 2] = answer[0, 5, 1, 2] = 30
    loss_of = YoloLoss(ONE, (16, 8))
    box = [5 - 2, 3 - 3, 5 + 2, 3 + 3]  # the anchor of 4 × 6 in the middle of cell 1, 2 of 2 × 2 pixels
    assert float(loss_of([answer], [labelled(box)])) == pytest.approx(0, abs=1e-5)
    assert float(loss_of([answer], [labelled()])) == pytest.approx(30, rel=1e-3)
    assert float(loss_of([answer], [labelled(box, ignored=True)])) == pytest.approx(0, abs=1e-5)


def test_a_box_that_is_near_is_let_alone() -> None:
    """The cell beside the right one predicts nearly the same box: neither right nor wrong."""
    answer = head(-30)
    answer[0, 4:6, 1, 2:4] = 30
    answer[0, 0, 1, 3] = -30  # its middle is where cell 3 begins: 1 pixel to the right, overlap 3/5
    box = [3, 0, 7, 6]
    for near, cost in ((0.55, pytest.approx(0, abs=1e-4)), (0.65, pytest.approx(30, abs=0.1))):
        with constants(loss, IGNORED_IOU=near):
            assert float(YoloLoss(ONE, (16, 8))([answer], [labelled(box)])) == cost


def test_overlap_is_that_of_the_detector() -> None:
    rng = np.random.default_rng(0)
    low = rng.uniform(0, 5, (2, 20, 2))
    a, b = np.concatenate([low, low + rng.uniform(1, 6, (2, 20, 2))], axis=2)
    expected = np.diag(overlaps(a, b))
    ours = iou(torch.from_numpy(a), torch.from_numpy(b))
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    assert (ciou(torch.from_numpy(a), torch.from_numpy(b)) <= ours).all()


def test_complete_iou_by_hand() -> None:
    a, b = torch.tensor([[0.0, 0.0, 2.0, 2.0]]), torch.tensor([[2.0, 0.0, 4.0, 2.0]])
    assert float(ciou(a, a)) == pytest.approx(1)
    assert float(ciou(a, b)) == pytest.approx(-4 / 20)  # apart by 2 in a hull of 4 × 2


def test_a_new_network_expects_no_people() -> None:
    network = new_network(YoloSmall.ANCHORS, 0.01).eval()
    with torch.inference_mode():
        answers = network(torch.rand(1, 3, 64, 64))
    assert [answer.shape[2:] for answer in answers] == [(2, 2), (4, 4), (8, 8)]
    assert all(answer[0, 4::6].sigmoid().max() < 0.03 for answer in answers)


def test_anchors_grow_with_the_input() -> None:
    assert scaled_anchors((512, 384)) == YoloSmall.ANCHORS
    assert scaled_anchors((256, 384))[0] == pytest.approx((5.6, 16.8))


def test_a_training_that_was_left_ends_with_the_same_weights(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole.weights", tmp_path / "parts.weights"
    trainer(whole).run()

    def leave(training: TrainingLoop) -> None:
        if training.step == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer(parts).run(leave)
    resumed = trainer(parts)
    assert resumed.step == 4
    resumed.run()
    assert whole.read_bytes() == parts.read_bytes()
    assert whole.with_suffix(".csv").read_text() == parts.with_suffix(".csv").read_text()
    assert VictimDetector.load(whole.with_suffix(".cfg"), whole)


def test_another_training_does_not_take_it_up(tmp_path: Path) -> None:
    out = tmp_path / "w.weights"
    trainer(out).run()
    with pytest.raises(InputError, match=r"w\.checkpoint"):
        trainer(out, images=40)


def test_it_learns(tmp_path: Path) -> None:
    fast = YoloOptimization(averaging=0.9)
    plain = CanvasAugmentation(odds=0)
    config = replace(CONFIG, steps=120, validate_every=120, batch=8, optimization=fast, augmentation=plain)
    training = trainer(tmp_path / "w.weights", config, 60, 30)
    before = validate(training.result, (64, 64), WhiteBoxes(30, 1), 0.01)
    training.run()
    assert before < 0.1
    assert training.score > 0.5


def test_what_cannot_be_done_is_refused(tmp_path: Path) -> None:
    for wrong in ({"steps": 0}, {"batch": 0}):
        with pytest.raises(InputError):
            YoloTrainingConfig(**wrong)
    for wrong in ({"width": 100}, {"height": 0}):
        with pytest.raises(InputError, match="multiples of 32"):
            trainer(tmp_path / "w.weights", replace(CONFIG, **wrong))
    with pytest.raises(InputError, match="validation"):
        trainer(tmp_path / "w.weights", validated=0)
