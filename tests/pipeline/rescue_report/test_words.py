"""Numbers as people read them."""

import numpy as np
import pytest

from pipeline.rescue_report import words
from pipeline.victims.display import letters


def test_numbers_as_people_read_them() -> None:
    assert [words.number(-1.25, 1), words.number(-0.04)] == ["−1.2", "0.0"]
    assert words.place([-0.51, 2]) == "(−0.5, 2.0) m"
    assert [words.percent(share) for share in (0, 0.5, 0.996, 1)] == ["0%", "50%", "99%", "100%"]
    assert [words.counted(n, "drop") for n in range(3)] == ["no drops", "1 drop", "2 drops"]
    assert [words.minutes(s) for s in (9.6, 60, 3725)] == ["10 s", "1 min 00 s", "62 min 05 s"]


@pytest.mark.parametrize(
    ("degrees", "turn", "side"),
    [
        (10, "straight on", "straight ahead"),
        (-31, "bear right by 30°", "31° to the right"),
        (450, "turn left by 90°", "90° to the left"),
        (-170, "turn around", "behind"),
    ],
)
def test_turns_and_sides(degrees: float, turn: str, side: str) -> None:
    assert words.turn(np.deg2rad(degrees)) == turn
    assert words.side(np.deg2rad(degrees)) == side


def test_letters_go_on_after_z() -> None:
    assert [letters(k) for k in (0, 25, 26, 51, 52, 701, 702)] == ["A", "Z", "AA", "AZ", "BA", "ZZ", "AAA"]
