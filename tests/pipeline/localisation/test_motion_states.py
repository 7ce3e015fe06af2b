"""What a frame says about the motion: exact cases."""

import numpy as np

from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.motion_states import log_likelihoods
from pipeline.localisation.registration import Registration, Target
from pipeline.transforms import from_yaw
from tests.pipeline.still_robot import WALL, StillRobot

CONFIG = RegistrationConfig()


def wall_at(x: float) -> Target:
    """Points of a wall across the x axis, 5 cm apart, that faces the robot."""
    y, z = np.meshgrid(np.arange(-0.8, 0.8, 0.05), np.arange(0.1, 1.0, 0.05))
    points = np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])
    return Target(points, np.tile([-1.0, 0.0, 0.0], (y.size, 1)), np.zeros(y.size, np.int64))


def at(x: float, yaw: float = 0.0) -> Registration:
    """A registration that fits nowhere, at a pose that the priors expect."""
    return Registration(from_yaw(x, 0, 0, yaw), np.zeros((6, 6)), np.eye(6), 0.0, 0.0, np.eye(6), True, False)


def test_the_pose_from_which_the_wall_is_where_it_was_is_likelier() -> None:
    frame, target = StillRobot().sense(), wall_at(WALL)
    moved, right = log_likelihoods([at(-0.3), at(0.0)], target, frame, CONFIG)
    assert right > moved + np.log(100)


def test_where_nothing_is_where_it_was_the_pose_with_less_in_view_is_not_likelier() -> None:
    """The map knows only a wall that the robot cannot see; turned aside, it would have little of that in view."""
    frame, target = StillRobot().sense(), wall_at(WALL + 1)
    ahead, aside = log_likelihoods([at(0.0), at(0.0, np.deg2rad(30))], target, frame, CONFIG)
    assert ahead == aside
