"""Coverage: the share of the drivable ground that was seen."""

import numpy as np
from numpy.typing import NDArray

from sarsim.ground_truth.true_surface import Survey, TrueSurface
from sarsim.scoring.coverage_kernels import see
from sarsim.simulated_robot import SimulatedRobot

SEEN_HEIGHT = 0.15  # m; a cell counts as seen if a return is nearer than this to its ground


class Coverage:
    """Marks the cells of the true ground that returns show.

    Attributes:
        surface: the true ground.
        seen: (nx, ny) bool on its grid.
    """

    def __init__(self, robot: SimulatedRobot):
        """The ground is the one to which the robot can drive from its current pose."""
        with robot.arena.naming():
            survey = Survey(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body, robot.model)
            self.surface: TrueSurface = survey.surface_from(robot.trajectory[-1].T_world_base[:3, 3])
        self.seen = np.zeros(self.surface.grid.shape, np.bool_)

    def see(self, points: NDArray[np.float32]) -> None:
        """Mark the cells that (N, 3) returns, m in the world, fell in."""
        grid = self.surface.grid
        see(points, grid.origin, grid.cell, self.surface.height, SEEN_HEIGHT, self.seen)

    @property
    def fraction(self) -> float:
        """Share of the drivable area that was seen."""
        return float(self.seen[self.surface.drivable].mean())
