"""Scores of the robot's driving."""

from functools import cached_property
from typing import Any

import numpy as np

from pipeline.elevation_map.traversability import Traversability
from pipeline.navigation.commands import Outcome
from pipeline.navigation.navigator import Navigator
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.scoring.oracle import true_traversability
from sarsim.scoring.pace import time_figures
from sarsim.scoring.trajectory import driven, motion_figures
from sarsim.simulated_robot import SimulatedRobot


class NavigationScore:
    """Scores how a robot drives, no matter what controls it."""

    def __init__(self, robot: SimulatedRobot, surface: GroundTruthSurface):
        """Start scoring at the robot's current pose; ``surface``: the true ground."""
        self._robot, self._surface, self._first = robot, surface, len(robot.trajectory) - 1

    @cached_property
    def ground(self) -> Traversability:
        """The true ground, as the robot's planner would see it."""
        return true_traversability(self._surface, self._robot.model)

    def report(self) -> dict[str, Any]:
        """The figures for report.json; speed and times are missing if the robot received no command."""
        trajectory = self._robot.trajectory[self._first :]
        contacts, motion = self._robot.collisions.collisions, motion_figures(self._robot.trajectory)
        figures: dict[str, Any] = {"collisions": contacts, **motion}
        if len(trajectory) > 1:
            figures["mean_speed"] = driven(trajectory) / (trajectory[-1].time - trajectory[0].time)
            figures["time_s"] = time_figures(trajectory, self.ground)
        return figures


def navigation_figures(navigator: Navigator, score: NavigationScore, kidnaps: int) -> dict[str, Any]:
    """The figures of all drives for report.json; ``kidnaps``: how often the robot was carried."""
    return {
        "legs": len(navigator.legs),
        "reached": sum(leg.outcome is Outcome.REACHED for leg in navigator.legs),
        "kidnapped": kidnaps,
        "stuck": sum(leg.outcome is Outcome.STUCK for leg in navigator.legs),
        "recovered": navigator.recovered,
        **_time_figures(navigator),
        **score.report(),
    }


def _time_figures(navigator: Navigator) -> dict[str, float]:
    """The median ratio of planned to driven time; empty if the robot moved on no planned drive."""
    ratios = [time.planned / time.driven for time in navigator.times if time.driven > 0 and time.planned > 0]
    return {"planned_over_driven": float(np.median(ratios))} if ratios else {}
