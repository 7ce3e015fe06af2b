"""Coverage: the fraction of the drivable ground that was seen."""

import numpy as np
from numpy.typing import NDArray

from sarsim.ground_truth.true_surface import GroundTruthSurface, Survey
from sarsim.scoring.coverage_kernels import see
from sarsim.simulated_robot import SimulatedRobot

SEEN_HEIGHT = 0.15  # m; a cell has been seen if a return in it is less than this above or below its ground


class Coverage:
    """Records the cells of the true ground that have been seen.

    Attributes:
        surface: the true ground.
        seen: (nx, ny) bool, whether each cell of the surface's grid has been seen.
    """

    def __init__(self, robot: SimulatedRobot):
        """Survey the ground that the robot can reach from its current pose."""
        with robot.arena.prefixing_errors():
            survey = Survey(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body, robot.model)
            self.surface: GroundTruthSurface = survey.surface_from(robot.trajectory[-1].T_world_base[:3, 3])
        self.seen = np.zeros(self.surface.grid.shape, np.bool_)

    def see(self, points: NDArray[np.float32]) -> None:
        """Mark the cells whose ground is shown by the returns ``points`` (N, 3), m in ``world``."""
        grid = self.surface.grid
        see(points, grid.origin, grid.cell, self.surface.height, SEEN_HEIGHT, self.seen)

    @property
    def fraction(self) -> float:
        """Fraction of the drivable area that has been seen."""
        return float(self.seen[self.surface.drivable].mean())
