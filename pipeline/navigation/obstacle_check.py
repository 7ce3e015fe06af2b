"""The lookout: glances on the way, while the map is as old as the last look.

A plan leads over ground that the map shows free. Until the next look the robot would follow it blindly; a glance at
the depth image tells whether something stands there by now.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.traversability.traversability import Traversability


@dataclass(frozen=True)
class ObstacleCheckConfig:
    """What stands in the way.

    Attributes:
        stride: m of driving straight on between two glances.
        near: the camera sees nothing nearer to the robot's middle, m.
        far: what is further away does not count yet, m.
        beyond: nor what is further than this behind the way point, m: the robot's front comes to stand there.
        half_width: of the corridor, m.
        low, high: m above the ground that the map knows; what rises between them holds the robot.
        min_points: returns in a cell; noise leaves none there and the thickest dust at most 17, measured.
    """

    stride: float = 0.4
    near: float = 0.9
    far: float = 2.0
    beyond: float = 0.35
    half_width: float = 0.27
    low: float = 0.15
    high: float = 0.6
    min_points: int = 50


class ObstacleCheck:
    """Watches the way of one drive.

    Attributes:
        obstacles: (N, 3) what stands in the way that the surface does not know, m in ``map``.
    """

    def __init__(
        self,
        glance: Callable[[], NDArray[np.float32]],
        traversability: Traversability,
        config: ObstacleCheckConfig | None = None,
    ):
        """``glance``: gives (N, 3) the returns that the camera has now, m in ``map``."""
        self.config = config or ObstacleCheckConfig()
        self.obstacles = np.zeros((0, 3), np.float32)
        self._glance, self._surface = glance, traversability
        self._target: NDArray[np.float64] | None = None
        self._last = np.zeros(2)

    def is_clear(self, position: NDArray[np.float64], target: NDArray[np.float64]) -> bool:
        """Whether nothing stands between the robot and a way point (2,) that it drives straight to.

        It glances when the way point is new, and every ``stride``; not when the way point is nearer than it can see.
        """
        config, is_new = self.config, target is not self._target
        if np.linalg.norm(target - position) + config.beyond < config.near:
            return True
        if is_new or np.linalg.norm(position - self._last) >= config.stride:
            self._target, self._last = target, position
            self.obstacles = obstacles_between(position, target, self._glance(), self._surface, config)
        return not len(self.obstacles)


def obstacles_between(
    start: NDArray[np.float64],
    target: NDArray[np.float64],
    points: NDArray[np.float32],
    traversability: Traversability,
    config: ObstacleCheckConfig,
) -> NDArray[np.float32]:
    """(M, 3) those of the points (N, 3) that stand between two places (2,) on ground known as drivable."""
    length = max(float(np.linalg.norm(target - start)), 1e-6)
    ahead = (target - start) / length
    along = (points[:, :2] - start) @ ahead
    across = (points[:, :2] - start) @ np.array([-ahead[1], ahead[0]])
    on_way = (
        (along > 0) & (along < min(length + config.beyond, config.far)) & (abs(across) < config.half_width)
    )
    near = points[on_way]
    height = near[:, 2] - traversability.grid.at(traversability.elevation, near, outside=np.nan)
    near = near[
        traversability.grid.at(traversability.traversable, near)
        & (height > config.low)
        & (height < config.high)
    ]
    _, cell, count = np.unique(
        traversability.grid.cell_of(near), axis=0, return_inverse=True, return_counts=True
    )
    return near[count[cell.ravel()] >= config.min_points]
