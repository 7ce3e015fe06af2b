"""Everything that reads a recording and writes results uses the numbers of the settings, and the camera's range."""

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.config import PipelineConfig
from pipeline.io_config import IoConfig
from pipeline.plugins.finds.config import FindsConfig
from pipeline.plugins.league.config import LeagueConfig
from pipeline.sensor import XTION
from sarsim.commands.map_recording import open_recording
from sarsim.commands.recorded_drive import RecordedDrive
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.robots.model import robot_model
from sarsim.settings import MapRecordingConfig
from tests.config_audit import Audit, fresh
from tests.pipeline.datasets.recorded_room import write_tum_folder


def test_all_numbers_of_recordings_and_results_are_those_of_the_settings(tmp_path: Path) -> None:
    config = MapRecordingConfig(
        path=write_tum_folder(tmp_path / "recording", number=4),
        out=tmp_path / "out",
        depth_range=(0.8, 3.5),  # otherwise the range of the metric map follows the camera's
        labels="rules",
        detector=None,
        mission="league",
        plugins={"finds": fresh(FindsConfig()), "league": fresh(LeagueConfig())},
        pipeline=fresh(PipelineConfig()),
        io=fresh(IoConfig()),
    )
    audit = Audit(config.pipeline, config.io, *config.plugins.values())
    with audit.calls():
        drive = RecordedDrive(open_recording(config), config)
        drive.run()
    audit.note_held(drive)
    assert drive.labelled and audit.foreign == set()


@pytest.mark.parametrize(("given", "mapped"), [(XTION.farthest, 6.0), (2.5, 2.5)])
def test_the_metric_map_reaches_as_far_as_the_camera_unless_the_settings_say_how_far(
    given: float, mapped: float
) -> None:
    metric_map = replace(TRUE_LABELS.pipeline.metric_map, max_range=given)
    settings = replace(TRUE_LABELS, pipeline=replace(TRUE_LABELS.pipeline, metric_map=metric_map))
    mapper = make_mapper(settings, robot_model(), sensor=replace(XTION, farthest=6.0))
    assert mapper.metric_map.max_range == mapped
