"""What counts as a traverse of a lane: poses, times and posts worked out by hand."""

from math import cos, radians, sin, sqrt

import mujoco
import numpy as np
import pytest

from pipeline.transforms import from_yaw
from sarsim.plugins.lanes.judge import LaneJudge, fallen_posts, is_in_end_zone
from sarsim.plugins.lanes.lanes import Lane
from sarsim.robots.model import robot_model
from sarsim.scoring.trajectory import is_tipped

LANE, PIONEER = Lane(), robot_model()
"""0.508 × 0.497 m."""


def rolled(degrees):
    """A pose in the end zone at +x that leans to a side."""
    T, c, s = from_yaw(1.8, 0, 0, 0), cos(radians(degrees)), sin(radians(degrees))
    T[1:3, 1:3] = [[c, -s], [s, c]]
    return T


@pytest.mark.parametrize(
    ("yaw", "reach"), [(180, 0.254), (90, 0.2485), (45, (0.254 + 0.2485) / sqrt(2)), (135, 0.5025 / sqrt(2))]
)
@pytest.mark.parametrize("end", [1, -1])
def test_the_whole_robot_must_be_in_the_end_zone(yaw, reach, end):
    for beyond, is_in in ((1e-6, True), (-1e-6, False)):
        T = from_yaw(end * (1.2 + reach + beyond), 0.3, 0.1, np.deg2rad(yaw))
        assert is_in_end_zone(T, end, PIONEER, LANE) is is_in
        assert not is_in_end_zone(T, -end, PIONEER, LANE)


def test_the_first_moment_in_the_zone_counts():
    judge = LaneJudge(LANE, PIONEER, towards=1, start_time=10.0, time_limit=60.0)
    for time, x in ((10.0, -1.8), (20.0, 1.4), (30.0, 1.5), (40.0, 1.0), (50.0, 1.8)):
        assert judge.see(time, from_yaw(x, 0, 0, 0))
    assert judge.crossing_time == 30.0
    assert judge.seconds == 20.0


def test_too_late_is_no_traverse():
    judge = LaneJudge(LANE, PIONEER, towards=-1, start_time=10.0, time_limit=60.0)
    assert judge.see(70.0, from_yaw(-1.4, 0, 0, 0))
    assert not judge.see(70.1, from_yaw(-1.8, 0, 0, 0))
    assert judge.seconds is None
    assert not judge.has_tipped


def test_a_robot_that_fell_over_does_not_get_across():
    judge = LaneJudge(LANE, PIONEER, towards=1, start_time=0.0, time_limit=60.0)
    assert judge.see(1.0, from_yaw(0, 0, 0, 0))
    assert not judge.see(2.0, rolled(46))
    assert not judge.see(3.0, rolled(0))
    assert judge.has_tipped and judge.seconds is None


def test_who_falls_in_the_end_zone_has_got_across_before():
    judge = LaneJudge(LANE, PIONEER, towards=1, start_time=0.0, time_limit=60.0)
    assert judge.see(1.0, rolled(44))
    assert not judge.see(2.0, rolled(-46))
    assert judge.has_tipped and judge.seconds == 1.0


def test_leaning_by_more_than_45_degrees_is_a_fall():
    assert [is_tipped(rolled(degrees)) for degrees in (0, 44.9, 45.1, 90, 180, -45.1)] == [False, False, *[True] * 4]


def test_posts_that_lie_are_counted_and_nothing_else():
    poses = {"post_1": "0", "post_2": "44", "post_3": "46", "post_4": "90", "plank": "90"}
    bodies = [f'<body name="{n}" euler="{a} 0 0"><freejoint/><geom size=".1"/></body>' for n, a in poses.items()]
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{''.join(bodies)}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert fallen_posts(model, data) == {"post_3", "post_4"}
