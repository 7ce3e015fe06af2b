"""Kept answers, and files in their folder that are no valid answers."""

import zlib
from pathlib import Path

import numpy as np
import pytest

from pipeline.network_cache import Answers, RecallingDetector
from pipeline.victims.detection.detection import Detection


def ask(answers: Answers, question: int, answer: list[float]) -> list[float]:
    return answers.recall([np.arange(question)], np.float32, (1, 2), lambda: np.array([answer])).tolist()[0]


def test_a_question_is_asked_once_and_others_are_asked(tmp_path: Path) -> None:
    answers = Answers(tmp_path / "answers")
    assert ask(answers, 1, [0.25, 0.5]) == ask(answers, 1, [9.0, 9.0]) == [0.25, 0.5]
    assert ask(answers, 2, [9.0, 8.0]) == [9.0, 8.0]
    assert answers.recalled == 1
    later = Answers(tmp_path / "answers")
    assert ask(later, 1, [8.0, 8.0]) == [0.25, 0.5] and later.recalled == 1


@pytest.mark.parametrize("broken", ["cut", "empty", "noise", "nan", "long", "short"])
def test_what_is_no_answer_is_asked_again(broken: str, tmp_path: Path) -> None:
    ask(Answers(tmp_path), 1, [np.nan if broken == "nan" else 0.25, 0.5])
    (path,) = tmp_path.iterdir()
    forged = {"long": bytes(10_000_000), "short": bytes(4)}
    content = zlib.compress(forged[broken]) if broken in forged else path.read_bytes()
    path.write_bytes({"cut": content[:-2], "empty": b"", "noise": b"\x07" * 50}.get(broken, content))
    answers = Answers(tmp_path)
    assert ask(answers, 1, [1.0, 2.0]) == [1.0, 2.0] and answers.recalled == 0


def test_a_question_may_be_empty(tmp_path: Path) -> None:
    answers = Answers(tmp_path)
    for _ in range(2):
        nothing = answers.recall([np.zeros((0, 3))], np.float32, (0, 8), lambda: np.zeros((0, 8)))
        assert nothing.shape == (0, 8) and nothing.dtype == np.float32
    assert answers.recalled == 1


def test_people_are_recalled_to_the_last_bit(tmp_path: Path) -> None:
    (tmp_path / "weights").write_bytes(b"1")
    found = [Detection((0.1, 1 / 3, 20.5, 30.0), 0.9), Detection((1.0, 2.0, 3.0, 4.0), 0.3)]

    class Eye:
        asked = 0

        def detect(self, rgb: np.ndarray) -> list[Detection]:
            self.asked += 1
            return found if rgb.any() else []

    eye, black, white = Eye(), np.zeros((4, 6, 3), np.uint8), np.ones((4, 6, 3), np.uint8)
    detector = RecallingDetector(eye, Answers(tmp_path / "answers"), tmp_path / "weights")
    for _ in range(2):
        assert detector.detect(white) == found and detector.detect(black) == []
    assert eye.asked == 2
    (tmp_path / "weights").write_bytes(b"2")
    RecallingDetector(eye, Answers(tmp_path / "answers"), tmp_path / "weights").detect(white)
    assert eye.asked == 3
