"""What an episode costs: by stage, and over its world."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

from scripts.benchmarks.cost import Sampler, measure, peak_memory, reset_peak_memory
from scripts.benchmarks.settings import CostSettings
from tests.sarsim.rooms import room


def test_the_shares_are_those_of_the_whole_and_the_world_is_less(tmp_path: Path) -> None:
    arena = tmp_path / "room.xml"
    arena.write_text(room((-0.6, 1.4), (-0.8, 0.8)))
    figures = measure(CostSettings(arenas=(str(arena),), steps=1)).figures
    of_arena = {name.removeprefix(f"{arena}."): value for name, value in figures.items()}
    shares = {name: value for name, value in of_arena.items() if name.startswith("share.")}
    assert sum(shares.values()) == pytest.approx(1)
    assert {"share.detector", "share.labels", "share.images", "share.scores"} <= shares.keys()
    assert of_arena["over_world"] == pytest.approx(of_arena["processor_s"] / of_arena["world_s"])
    assert of_arena["over_world"] > 1


def test_the_time_of_every_thread_counts_and_that_of_waiting_does_not() -> None:
    def work() -> None:
        end = time.thread_time() + 0.2
        while time.thread_time() < end:
            pass

    other = threading.Thread(target=work)
    with Sampler() as sampler:
        other.start()
        work()
        other.join()
        time.sleep(0.2)
    assert sum(sampler.seconds.values()) == pytest.approx(0.4, rel=0.3)


def test_the_peak_of_an_episode_leaves_out_what_an_earlier_one_used() -> None:
    earlier = np.ones(int(0.5e9 / 8))
    at_peak = peak_memory()
    del earlier
    reset_peak_memory()
    assert 0.4 < at_peak - peak_memory() < at_peak
