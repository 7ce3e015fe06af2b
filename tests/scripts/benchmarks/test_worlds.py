"""Missions in the leagues' worlds: which are played, and what is counted."""

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.errors import InputError
from scripts.benchmarks.episodes import world_name
from scripts.benchmarks.settings import WorldsSettings
from scripts.benchmarks.worlds import figures, job_of, measure, run_job, table, worlds_in
from tests.pipeline.victims.detection.networks import darknet_files

HALL = (
    "<sdf version='1.6'><world name='hall'><model name='ground'><link name='l'><collision name='c'>"
    "<pose>0 0 -0.1 0 0 0</pose><geometry><box><size>6 5 0.2</size></box></geometry></collision></link></model>"
    "<model name='victim_hot'><pose>2 1 0 0 0 0</pose><link name='l'><visual name='v'><pose>0 0 0.2 0 0 0</pose>"
    "<geometry><box><size>1.6 0.4 0.3</size></box></geometry></visual></link></model></world></sdf>"
)


def model(folder: Path, name: str) -> Path:
    (folder / name).mkdir()
    path = folder / name / "model.sdf"
    path.write_text(f"<sdf version='1.6'><model name='{name}'/></sdf>")
    return path


def test_worlds_and_the_models_that_none_of_them_includes(tmp_path: Path) -> None:
    alone, included = model(tmp_path, "levels"), model(tmp_path, "chair")
    world = tmp_path / "hall.world"
    world.write_text("<sdf version='1.6'><world name='w'><include><uri>model://chair</uri></include></world></sdf>")
    assert worlds_in(tmp_path) == [world, alone]
    assert [world_name(str(path)) for path in (world, included)] == ["hall", "chair"]


def test_no_world(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--worlds"):
        measure(WorldsSettings(worlds=tmp_path))


def test_a_mission_in_a_world(tmp_path: Path) -> None:
    (tmp_path / "hall.world").write_text(HALL)
    settings = WorldsSettings(worlds=tmp_path, minutes=0.05, runs=tmp_path / "runs")
    job = job_of(settings, tmp_path / "hall.world")
    job = replace(job, config=replace(job.config, labels="rules", detector=darknet_files(tmp_path)))
    (tmp_path / "runs").mkdir()
    run_job(job, tmp_path / "runs", settings.minutes)
    result = job.result(tmp_path / "runs")
    assert result is not None
    found = figures(result)
    assert found["victims"] == 1
    assert 0 < found["explored_m2"] <= found["ground_m2"] < 30
    assert 0.05 <= found["minutes"] < 0.15
    assert "score" in found
    assert table({"hall": result}).row_count == 1
