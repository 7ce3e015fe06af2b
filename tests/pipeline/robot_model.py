"""The robot model of the pipeline's tests: the size and abilities of a Pioneer 3-AT."""

import numpy as np

from pipeline.robot import RobotModel

PIONEER = RobotModel(
    length=0.508,
    width=0.497,
    body_height=0.3,
    headroom=0.65,
    max_step=0.04,
    max_gap=0.15,
    max_tilt=np.deg2rad(20),
    tipping_tilt=np.deg2rad(25),
    speed=0.2,
    ramp_speed=0.15,
    turn_rate=0.8,
    ramp_turn_rate=0.4,
    acceleration=0.3,
    turn_acceleration=np.deg2rad(100),
    ramp_slide=0.15,
    slide_per_radian=0.42,
    min_turn_rate=0.06,
)
