"""Where the time of a drive goes, on a floor of the tests' own."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.grid_map import Grid
from pipeline.transforms import from_yaw
from sarsim.ground_truth.true_surface import CELL, GroundTruthSurface
from sarsim.robots.pose import TrajectorySample
from sarsim.robots.skid_steered import robot_model
from sarsim.scoring.navigation import is_narrow, time_figures
from sarsim.scoring.oracle import true_traversability

ROBOT = robot_model()
PERIOD = 0.04


def ground(width: float = 4.0, slope: float = 0.0):
    """A floor of 8 m along x, and ``width`` m along y, around the origin, with walls; from x = 1 on it rises."""
    grid = Grid(np.array([-100, -60]), CELL, (200, 120))
    x, y = np.moveaxis(grid.centre_of(np.moveaxis(np.indices(grid.shape), 0, -1)), -1, 0)
    floor = (np.abs(x) < 4) & (np.abs(y) < width / 2)
    height = np.where(floor, slope * np.clip(x - 1, 0, None), np.nan)
    return true_traversability(GroundTruthSurface(grid, height, floor, np.zeros(grid.shape, np.bool_)), ROBOT)


def drive(*legs: tuple[float, float, float], start: Sequence[float] = (0.0, 0.0, 0.0)) -> list[TrajectorySample]:
    """The poses of a drive from ``start``: x, y and heading; a leg is s, m/s and rad/s."""
    x, y, heading = start
    poses = [TrajectorySample(0.0, from_yaw(x, y, 0, heading), np.eye(4))]
    for seconds, v, omega in legs:
        for _ in range(round(seconds / PERIOD)):
            x, y = x + v * PERIOD * np.cos(heading), y + v * PERIOD * np.sin(heading)
            heading += omega * PERIOD
            poses.append(TrajectorySample(poses[-1].time + PERIOD, from_yaw(x, y, 0, heading), np.eye(4)))
    return poses


def test_each_second_is_spent_driving_backing_turning_or_still() -> None:
    # An arc of 1 m is driven; one of 0.1 m turns in place, for the wheels of one side go back.
    legs = [(4, 0.2, 0), (2, -0.2, 0), (3, 0, 0.5), (1, 0, 0), (2, 0.3, 0.3), (1, 0.05, 0.5), (1, 0, -0.5)]
    times = time_figures(drive(*legs), ground())
    assert times == pytest.approx({"driving": 6, "backing": 2, "turning": 5, "still": 1, "narrow": 0, "ramp": 0})


@given(st.lists(st.tuples(st.floats(0, 2), st.floats(-0.5, 0.5), st.floats(-1, 1)), min_size=1, max_size=6))
def test_the_times_sum_up_to_the_whole(legs: list[tuple[float, float, float]]) -> None:
    trajectory = drive((PERIOD, 0, 0), *legs)
    times = time_figures(trajectory, ground())
    whole = sum(times[name] for name in ("driving", "backing", "turning", "still"))
    assert whole == pytest.approx(trajectory[-1].time)
    assert times["narrow"] <= times["driving"] and times["ramp"] <= times["driving"]


def test_springs_do_not_drive_and_who_is_carried_stands_still() -> None:
    shaking = drive(*[(PERIOD, v, w) for v, w in ((0.01, 0.04), (-0.01, -0.04))] * 20)
    away = replace(shaking[-1], time=shaking[-1].time + PERIOD, T_world_base=from_yaw(1, 1, 0, 2))
    times = time_figures([*shaking, away], ground())
    assert times["still"] == pytest.approx(away.time)


@pytest.mark.parametrize("heading", [0.0, np.pi])
def test_a_passage_less_than_twice_as_wide_as_the_robot_is_narrow_wherever_the_robot_is_in_it(heading: float) -> None:
    for width, narrow in ((0.9, True), (1.1, False)):
        assert (width < 2 * ROBOT.width) == narrow
        aside = np.array([0.0, 0.1, -0.1])
        places = np.column_stack([0 * aside, aside, np.full(3, heading)])
        assert (is_narrow(ground(width), places) == narrow).all()


def test_of_the_driving_the_time_in_narrow_places_and_on_ramps_is_told() -> None:
    legs = (4, 0.2, 0), (2, 0, 0.3)
    assert time_figures(drive(*legs), ground(width=0.8))["narrow"] == pytest.approx(4)
    times = time_figures(drive((10, 0.2, 0), start=(1.5, 0.0, 0.0)), ground(slope=0.2))
    assert times["ramp"] == pytest.approx(10)
    assert time_figures(drive((5, 0.2, 0), start=(-2.0, 0.0, 0.0)), ground(slope=0.2))["ramp"] == 0
