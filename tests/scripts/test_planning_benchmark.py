"""The times of planning steps: the names of the figures, and that the steps do plan."""

import pytest

from pipeline.errors import InputError
from scripts.benchmarks.planning import measure
from scripts.benchmarks.settings import PlanningSettings

STAGES = ("traversability", "reachable", "next_view", "topology", "way")


def test_a_step_is_at_least_as_long_as_its_longest_stage() -> None:
    figures = measure(PlanningSettings(frames=3, arenas=("nist_6x4",))).figures
    stages = [figures[f"nist_6x4.{stage}_ms"] for stage in STAGES]
    assert figures.keys() == {"large_over_small", "nist_6x4.step_ms", *(f"nist_6x4.{stage}_ms" for stage in STAGES)}
    assert 0 < max(stages) <= figures["nist_6x4.step_ms"] < 5000
    assert figures["nist_6x4.topology_ms"] > 1  # A new box changes the cells that the nodes see
    assert figures["large_over_small"] == 1


def test_no_step_is_nothing_to_measure() -> None:
    with pytest.raises(InputError, match="--frames 0"):
        measure(PlanningSettings(frames=0))
