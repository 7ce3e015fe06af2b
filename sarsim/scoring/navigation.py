"""How the robot has driven."""

from typing import Any

from pipeline.navigation.commands import Outcome
from pipeline.navigation.navigator import Navigator
from sarsim.scoring.trajectory import motion_figures
from sarsim.simulated_robot import SimulatedRobot


def navigation_figures(navigator: Navigator, robot: SimulatedRobot, kidnaps: int) -> dict[str, Any]:
    """The figures of all drives for report.json; ``kidnaps``: how often the robot was carried."""
    return {
        "legs": len(navigator.legs),
        "reached": sum(leg.outcome is Outcome.REACHED for leg in navigator.legs),
        "kidnapped": kidnaps,
        "stuck": sum(leg.outcome is Outcome.STUCK for leg in navigator.legs),
        "recovered": navigator.recovered,
        "collisions": robot.collisions.collisions,
        **motion_figures(robot.trajectory),
    }
