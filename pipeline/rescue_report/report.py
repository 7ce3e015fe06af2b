"""The rescue report of a run: people and finds as data, and the page."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from pipeline.exploration.viewpoint import Viewpoint
from pipeline.html_page import write_html
from pipeline.mapper import Keyframe, Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.page import page
from pipeline.rescue_report.records import write_finds, write_people
from pipeline.rescue_report.situation import Situation, situation_of
from pipeline.sink import Result, Sink, Step


class RescueReport(Sink):
    """Writes files with the data of people and finds, and logs the paths to the people to the recording.

    Attributes:
        end_reason: why exploration ended, see :attr:`Situation.end_reason`.
        situation: the robot's knowledge at the end of the run; None before the end.
    """

    finishing = "planning routes to the people found"

    def __init__(
        self, recorder: Recorder | None = None, *, config: RescueReportConfig = RescueReportConfig()
    ) -> None:
        self.end_reason: str | None = None
        self.situation: Situation | None = None
        self._recorder = recorder
        self._config = config
        self._camera_height = 0.0
        self._viewpoints_left: list[Viewpoint] = []

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Store the camera's height above the ground."""
        self._camera_height = float(keyframe.frame.T_base_camera[2, 3])

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Store why exploration ended and which viewpoints are left."""
        if step.explores:
            self.end_reason = step.end_reason or "interrupted"
            self._viewpoints_left = step.viewpoints_left

    def situation_in(self, mapper: Mapper) -> Situation:
        """The current situation according to a mapper's maps, which need at least one keyframe of this run."""
        return situation_of(mapper, self._camera_height, self.end_reason, self._viewpoints_left, self._config)

    def finish(self, result: Result) -> None:
        """Write the files and log the paths; InputError if a file cannot be written."""
        if not result.steps:
            return
        situation = self.situation = self.situation_in(result.mapper)
        write_people(result.folder, situation)
        write_finds(result.folder, situation)
        if self._recorder is not None:
            self._recorder.log_routes([person.route.trace for person in situation.everyone if person.route])


class RescuePage(Sink):
    """Writes the page for rescuers."""

    finishing = "writing the report page"

    def __init__(self, rescue_report: RescueReport):
        self._rescue_report = rescue_report

    def finish(self, result: Result) -> None:
        """Write the page from the situation and report.json's figures; InputError if the page cannot be written."""
        if (situation := self._rescue_report.situation) is not None:
            write_page(result.folder / "report.html", situation, result.report)


def write_page(path: Path, situation: Situation, report: Mapping[str, Any]) -> None:
    """Write the page from a situation and report.json's figures; InputError if the page cannot be written."""
    write_html(path, page(situation, report, datetime.now().astimezone()))
