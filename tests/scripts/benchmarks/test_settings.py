"""Settings of the benchmarks: which of them reach the episodes."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.config import PipelineConfig
from sarsim.settings import PerceptionConfig
from scripts.benchmarks.exploration import without_people
from scripts.benchmarks.runs import Job
from scripts.benchmarks.settings import EpisodesSettings, ExplorationSettings, FindsSettings, VictimsSettings
from scripts.benchmarks.victims import without_detector

PIPELINE = PipelineConfig(metric_map=replace(PipelineConfig().metric_map, voxel_size=0.2))
GIVEN: dict[str, Any] = {
    "labels": "my:Labels",
    "weights": Path("w"),
    "detector": (Path("d.onnx"),),
    "detector_names": Path("n"),
    "detector_class": "my:Detector",
    "reader": ("my:Reader",),
    "pipeline": PIPELINE,
}


@pytest.mark.parametrize("kind", [ExplorationSettings, FindsSettings, VictimsSettings])
def test_everything_that_sees_reaches_the_episodes(kind: type[EpisodesSettings]) -> None:
    assert GIVEN.keys() == {field.name for field in fields(PerceptionConfig)}
    episode = kind(**GIVEN).episode
    assert {name: getattr(episode, name) for name in GIVEN} == GIVEN


def test_episodes_without_a_detector_have_no_own_one_either() -> None:
    job = Job("random", ExplorationSettings(**GIVEN).episode)
    for bare in (without_people(job, "ground_only", "next_best_view"), without_detector(job)):
        assert (bare.config.detector, bare.config.detector_class) == (None, None)
