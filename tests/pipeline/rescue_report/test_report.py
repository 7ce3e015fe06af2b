"""Watching an explorer and writing its page."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer
from pipeline.mapper import Mapper
from pipeline.rescue_report.finds import write_finds
from pipeline.rescue_report.page import page
from pipeline.rescue_report.people import write_people
from pipeline.rescue_report.report import RescueReport, write_page
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.rescue_report.html_page import read
from tests.pipeline.rescue_report.people import before_a_wall
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot


def test_the_page_lists_what_was_not_worth_the_drive() -> None:
    view = Viewpoint(np.array([1.0, 2.0]), 0.0, turn=True, gain=0.03, seconds=87.0)
    assert "0.03 m² from (1.0, 2.0) m, 1 min 27 s" in page(replace(before_a_wall(None), left=[view]), {"arena": "a"})
    assert (
        "worth"
        not in page(before_a_wall(None), {"arena": "a"}).partition("Not explored")[2].partition("</section>")[0]
    )


def test_a_drive_to_goals_explores_nothing() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report = RescueReport()
    report.on_step(explorer.mapper, replace(explorer.step(), viewpoint=None, explores=False, ended=None))
    assert report.situation_in(explorer.mapper).ended is None


def test_the_last_step_says_whether_a_viewpoint_is_left() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report, step = RescueReport(), explorer.step()
    report.on_step(explorer.mapper, step)
    assert step.viewpoint is not None
    assert not report.situation_in(explorer.mapper).finished
    for ended in ("held", "shut_in", "time"):
        report.on_step(explorer.mapper, replace(step, viewpoint=None, ended=ended))
        assert not report.situation_in(explorer.mapper).finished
    report.on_step(explorer.mapper, replace(step, viewpoint=None, ended="nothing_left"))
    situation = report.situation_in(explorer.mapper)
    assert situation.finished
    np.testing.assert_array_equal(situation.T_map_entrance, np.eye(4))
    assert situation.positions.shape == (1, 2)  # a keyframe, whatever the number of steps
    assert not situation.searched


def test_marks_and_entrance_follow_a_correction_of_the_poses() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report = RescueReport()
    report.on_step(explorer.mapper, explorer.step())
    T_after_before = from_yaw(0.4, -0.2, 0.0, 0.3)
    corrected = T_after_before @ explorer.mapper.keyframes.poses
    explorer.mapper.correct(corrected)
    situation = report.situation_in(explorer.mapper)
    np.testing.assert_array_equal(situation.T_map_entrance, corrected[0])
    np.testing.assert_array_equal(situation.positions, corrected[-1:, :2, 3])


def test_the_page_is_a_file(tmp_path: Path) -> None:
    write_page(tmp_path / "report.html", before_a_wall(None), {"arena": "Fußweg"})
    write_people(tmp_path, before_a_wall(None))
    write_finds(tmp_path, before_a_wall(None))
    assert "Fußweg" in read((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "victims.json", "victims.csv", "finds.json"}


def test_a_page_that_cannot_be_written_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing/report\.html"):
        write_page(tmp_path / "missing" / "report.html", before_a_wall(None), {"arena": "a"})
