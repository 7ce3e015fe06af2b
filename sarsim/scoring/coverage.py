"""How much of the drivable ground was seen."""

import numpy as np
from numpy.typing import NDArray

from sarsim.ground_truth.true_surface import Survey, TrueSurface
from sarsim.simulated_robot import SimulatedRobot

SEEN_HEIGHT = 0.15  # m; a return this near to a cell's ground has seen the cell


class Coverage:
    """Marks what returns show of the true ground.

    Attributes:
        surface: the true ground.
        seen: (nx, ny) bool on its grid.
    """

    def __init__(self, robot: SimulatedRobot):
        """Of the ground that a robot can drive to from where it stands."""
        survey = Survey(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body)
        self.surface: TrueSurface = survey.surface_from(robot.trajectory[-1].T_world_base[:3, 3])
        self.seen = np.zeros(self.surface.grid.shape, np.bool_)

    def see(self, points: NDArray[np.float32]) -> None:
        """Mark the cells that (N, 3) returns, m in the world, fell in."""
        grid = self.surface.grid
        on_ground = np.abs(points[:, 2] - grid.at(self.surface.height, points, outside=np.nan)) < SEEN_HEIGHT
        self.seen |= grid.mask_of(points[on_ground])

    @property
    def fraction(self) -> float:
        """Share of the drivable area that was seen."""
        return float(self.seen[self.surface.drivable].mean())
