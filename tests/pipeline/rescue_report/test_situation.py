"""People's sizes, the evidence against the map, and what the report takes from a run."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.rescue_report.report import RescueReport, write_page
from pipeline.rescue_report.situation import BodySize, body_size_of, trust_in
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.polygon_scene import HALF, floor, look, pose, wall
from tests.pipeline.rescue_report.people import before_a_wall, block
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot

SCENE = [floor(-4, 4, -4, 4), wall((2.5, 2.5), (2.5, -2.5)), wall((-2.5, 2.5), (2.5, 2.5))]
T_BASE_CAMERA = pose(0.1, 0, 0.65, 0, 0.3)


def mapped(drift: float, slam: bool = False) -> Mapper:
    """The map of a robot that turns to and fro while its odometry drifts by ``drift`` m at each of 12 keyframes."""
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=Slam() if slam else OdometryLocalisation())
    for k in range(12):
        T = from_yaw(0, 0, 0, 0.3 * (k % 3))
        seen = look(SCENE, T @ T_BASE_CAMERA, 0.0, k, camera=HALF)
        believed = from_yaw(drift * k, 0, 0, 0) @ T
        frame = replace(seen, T_base_camera=T_BASE_CAMERA, T_odom_base=believed)
        mapper.add_frame(mapper.localise(frame), labelled=False)
    return mapper


@pytest.fixture(scope="module")
def true() -> Mapper:
    return mapped(0)


def test_a_right_map_is_as_its_keyframes_show_it(true: Mapper) -> None:
    trust = trust_in(true, RescueReportConfig())
    assert trust.contradicted < 0.005
    assert trust.deviation == 0
    assert trust.is_good


def test_a_map_whose_walls_stand_twice_contradicts_itself(true: Mapper) -> None:
    drifting = mapped(0.1)  # 1.1 m in all, which localisation by odometry alone does not notice
    assert trust_in(drifting, RescueReportConfig()).contradicted > 0.05
    assert not trust_in(drifting, RescueReportConfig()).is_good


def test_a_pose_graph_says_how_sure_it_is() -> None:
    mapper = mapped(0, slam=True)
    assert 0 < trust_in(mapper, RescueReportConfig()).deviation < 0.3
    assert trust_in(mapper, RescueReportConfig()).is_good
    assert trust_in(mapper, RescueReportConfig()).is_certain


@settings(max_examples=25, deadline=None)
@given(st.floats(-np.pi, np.pi), st.floats(-20, 20))
def test_the_size_does_not_depend_on_where_a_person_lies(yaw: float, x: float) -> None:
    size = body_size_of(block((x, 3, 0.5), (1.7, 0.5, 0.3), yaw))
    assert (size.length, size.width, size.height) == pytest.approx((1.7, 0.5, 0.3), abs=0.05)
    assert size.posture == "lying"


@pytest.mark.parametrize(
    ("size", "posture"),
    [((0.7, 0.6, 0.8), "sitting, kneeling or leaning"), ((0.3, 0.2, 0.2), ""), ((1.6, 0.7, 0.9), "")],
)
def test_a_size_determines_a_posture_or_does_not(size: tuple[float, float, float], posture: str) -> None:
    assert BodySize(*size).posture == posture


def test_a_single_point_has_no_size() -> None:
    assert body_size_of(np.zeros((1, 3), np.float32)) == BodySize(0, 0, 0)


def test_a_drive_to_goals_explores_nothing() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report = RescueReport()
    report.on_step(explorer.mapper, replace(explorer.step(), viewpoint=None, explores=False, end_reason=None))
    assert report.situation_in(explorer.mapper).end_reason is None


def test_the_last_step_says_whether_a_viewpoint_is_left() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report, step = RescueReport(), explorer.step()
    report.on_step(explorer.mapper, step)
    assert step.viewpoint is not None
    assert not report.situation_in(explorer.mapper).has_finished
    report.on_step(explorer.mapper, replace(step, viewpoint=None, end_reason="held"))
    assert not report.situation_in(explorer.mapper).has_finished
    report.on_step(explorer.mapper, replace(step, viewpoint=None, end_reason="nothing_left"))
    situation = report.situation_in(explorer.mapper)
    assert situation.has_finished
    np.testing.assert_array_equal(situation.poses[0], np.eye(4))
    assert situation.positions.shape == (1, 2)  # a keyframe, whatever the number of steps
    assert not situation.was_searched


def test_marks_and_entrance_follow_a_correction_of_the_poses() -> None:
    explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
    report = RescueReport()
    report.on_step(explorer.mapper, explorer.step())
    T_after_before = from_yaw(0.4, -0.2, 0.0, 0.3)
    corrected = T_after_before @ explorer.mapper.keyframes.poses
    explorer.mapper.correct(corrected)
    situation = report.situation_in(explorer.mapper)
    np.testing.assert_array_equal(situation.poses[0], corrected[0])
    np.testing.assert_array_equal(situation.positions, corrected[-1:, :2, 3])


def test_a_page_that_cannot_be_written_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing/report\.html"):
        write_page(tmp_path / "missing" / "report.html", before_a_wall(None), {"arena": "a"})
