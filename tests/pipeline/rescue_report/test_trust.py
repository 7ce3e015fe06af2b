"""The evidence of the robot's own data against its map."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper
from pipeline.rescue_report.config import TrustConfig
from pipeline.rescue_report.trust import trust_in
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
from tests.pipeline.polygon_scene import HALF, floor, look, pose, wall
from tests.pipeline.robot_model import PIONEER

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
    trust = trust_in(true, TrustConfig())
    assert trust.contradicted < 0.005
    assert trust.deviation == 0
    assert trust.is_good


def test_a_map_whose_walls_stand_twice_contradicts_itself(true: Mapper) -> None:
    drifting = mapped(0.1)  # 1.1 m in all, which localisation by odometry alone does not notice
    assert trust_in(drifting, TrustConfig()).contradicted > 0.05
    assert not trust_in(drifting, TrustConfig()).is_good


def test_a_pose_graph_says_how_sure_it_is() -> None:
    mapper = mapped(0, slam=True)
    assert 0 < trust_in(mapper, TrustConfig()).deviation < 0.3
    assert trust_in(mapper, TrustConfig()).is_good
    far = mapper.localisation
    assert isinstance(far, Slam)
    far.graph.link(0, 1, np.eye(6))  # a worse link changes nothing
    assert trust_in(mapper, TrustConfig()).is_certain
