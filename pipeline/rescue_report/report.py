"""Makes the rescue report from an explorer's steps."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer, Observer, Step
from pipeline.files import whole_file
from pipeline.rescue_report.finds import write_finds
from pipeline.rescue_report.page import page
from pipeline.rescue_report.people import write_people
from pipeline.rescue_report.situation import Situation, situation_of


class RescueReport(Observer):
    """Gathers the data of the report step by step."""

    def __init__(self) -> None:
        self._camera_height = 0.0
        self._finished = False
        self._left: list[Viewpoint] = []

    def on_step(self, explorer: Explorer, step: Step) -> None:
        """Add the newest step."""
        self._camera_height = float(step.keyframe.frame.T_base_camera[2, 3])
        if explorer.mission.goals is None:  # only exploring shows whether viewpoints are left
            self._finished, self._left = step.viewpoint is None and step.can_drive, step.left

    def situation(self, explorer: Explorer) -> Situation:
        """The present knowledge of an explorer that has made at least one step."""
        mapper, robot = explorer.mapper, explorer.robot.model
        return situation_of(mapper, robot, self._camera_height, self._finished, self._left)


def write_page(path: Path, situation: Situation, report: Mapping[str, Any]) -> None:
    """Write the page, with the figures of report.json; InputError if that is impossible."""
    with whole_file(path) as partial:
        partial.write_text(page(situation, report, datetime.now().astimezone()), encoding="utf-8")


def write_found(folder: Path, situation: Situation) -> None:
    """Write the people and all finds as data; InputError if a file cannot be written."""
    write_people(folder, situation)
    write_finds(folder, situation)
