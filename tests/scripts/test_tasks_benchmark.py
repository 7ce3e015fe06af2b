import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.tasks.grid_explorers import EXPLORERS
from sarsim.tasks.grid_scenes import draw_scene
from scripts.benchmarks.settings import TasksSettings
from scripts.benchmarks.tasks import SIZES, compare, interval, measure, steps_per_s


def test_every_explorer_is_compared_with_an_interval() -> None:
    figures = compare([draw_scene(seed, *SIZES["papers"]) for seed in (0, 1)], "drawn")
    for name in EXPLORERS:
        assert figures[f"{name}.way.low"] <= figures[f"{name}.way"] <= figures[f"{name}.way.high"]
    assert figures["viewpoint_tour.explored"] == 1.0
    assert steps_per_s(5) > 0


def test_a_ratio_has_an_interval_resampled_by_map() -> None:
    way = np.array([1.0, 2.0, 3.0])
    assert set(interval("same", way, 2 * way).values()) == {0.5}


def test_a_number_of_maps_is_not_negative() -> None:
    with pytest.raises(InputError, match="--drawn -1"):
        measure(TasksSettings(drawn=-1))
