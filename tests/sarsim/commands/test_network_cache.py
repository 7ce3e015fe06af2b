"""Cached outputs, and files in their folder that are no valid outputs."""

import zlib
from pathlib import Path

import numpy as np
import pytest

from pipeline.victims.detection import Detection
from sarsim.commands.network_cache import CachedDetector, OutputCache


def get(cache: OutputCache, inputs: int, output: list[float]) -> list[float]:
    return cache.get([np.arange(inputs)], np.float32, (1, 2), lambda: np.array([output])).tolist()[0]


def test_a_network_runs_once_for_the_same_inputs(tmp_path: Path) -> None:
    cache = OutputCache(tmp_path / "cache")
    assert get(cache, 1, [0.25, 0.5]) == get(cache, 1, [9.0, 9.0]) == [0.25, 0.5]
    assert get(cache, 2, [9.0, 8.0]) == [9.0, 8.0]
    assert cache.hits == 1
    later = OutputCache(tmp_path / "cache")
    assert get(later, 1, [8.0, 8.0]) == [0.25, 0.5] and later.hits == 1


@pytest.mark.parametrize("broken", ["cut", "empty", "noise", "nan", "long", "short"])
def test_it_runs_again_if_a_file_is_no_output(broken: str, tmp_path: Path) -> None:
    get(OutputCache(tmp_path), 1, [np.nan if broken == "nan" else 0.25, 0.5])
    (path,) = tmp_path.iterdir()
    forged = {"long": bytes(10_000_000), "short": bytes(4)}
    content = zlib.compress(forged[broken]) if broken in forged else path.read_bytes()
    path.write_bytes({"cut": content[:-2], "empty": b"", "noise": b"\x07" * 50}.get(broken, content))
    cache = OutputCache(tmp_path)
    assert get(cache, 1, [1.0, 2.0]) == [1.0, 2.0] and cache.hits == 0


def test_a_question_may_be_empty(tmp_path: Path) -> None:
    cache = OutputCache(tmp_path)
    for _ in range(2):
        nothing = cache.get([np.zeros((0, 3))], np.float32, (0, 8), lambda: np.zeros((0, 8)))
        assert nothing.shape == (0, 8) and nothing.dtype == np.float32
    assert cache.hits == 1


def test_people_are_recalled_to_the_last_bit(tmp_path: Path) -> None:
    (tmp_path / "weights").write_bytes(b"1")
    found = [Detection((0.1, 1 / 3, 20.5, 30.0), 0.9), Detection((1.0, 2.0, 3.0, 4.0), 0.3)]

    class Eye:
        asked = 0

        def detect(self, rgb: np.ndarray) -> list[Detection]:
            self.asked += 1
            return found if rgb.any() else []

    eye, black, white = Eye(), np.zeros((4, 6, 3), np.uint8), np.ones((4, 6, 3), np.uint8)
    detector = CachedDetector(eye, OutputCache(tmp_path / "cache"), tmp_path / "weights")
    for _ in range(2):
        assert detector.detect(white) == found and detector.detect(black) == []
    assert eye.asked == 2
    (tmp_path / "weights").write_bytes(b"2")
    CachedDetector(eye, OutputCache(tmp_path / "cache"), tmp_path / "weights").detect(white)
    assert eye.asked == 3
