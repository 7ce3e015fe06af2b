"""Baselines of exploration, behind the interface of :class:`pipeline.exploration.next_best_view.Exploration`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.exploration.next_best_view import MIN_GAIN, Exploration, Viewpoint
from pipeline.exploration.visibility_kernels import CameraView
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability


class NearestFrontier(Exploration):
    """Drives to the nearest place from which unseen ground should come into view (Yamauchi 1997).

    There it looks where most should be seen. What counts as unseen, what the camera should show from where, and when
    to give up are the same as for the robot's own exploration; how much a viewpoint shows for the time that it costs,
    and the time for turning, do not count. As with Yamauchi, frontiers smaller than the robot come last.
    """

    def __init__(self, robot: RobotModel):
        super().__init__(robot)
        self._robot_size = robot.length * robot.width

    def worth(
        self, gains: NDArray[np.float64], distance: NDArray[np.float64], seconds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, RAYS) m² of the nearest place that is worth the drive, 0 elsewhere; see the base class."""
        large = gains >= (self._robot_size if (gains >= self._robot_size).any() else MIN_GAIN)
        near = distance == np.where(large.any(axis=1), distance, np.inf).min()
        return np.where(large & near[:, None], gains, 0.0)


class RandomWalk(Exploration):
    """Takes keyframes in random directions from random places that are not far, until it has taken so many."""

    def __init__(self, robot: RobotModel, seed: int, stride: float = 2.0, steps: int = 300):
        """``stride``: the way to the next place is no longer than this, m; ``steps``: after so many it ends."""
        super().__init__(robot)
        self._rng = np.random.default_rng(seed)
        self._farthest, self._steps_left = stride, steps

    def next_viewpoint(
        self,
        traversability: Traversability,
        measured: NDArray[np.float32],
        paths: ShortestPaths,
        T_map_base: NDArray[np.float64],
        camera: CameraView,
    ) -> Viewpoint | None:
        """A random viewpoint; None at the end, and where the robot can drive nowhere."""
        cells = np.argwhere(traversability.turnable & (paths.cost <= self._farthest))
        if not len(cells) or not self._steps_left:
            return None
        self._steps_left -= 1
        place = traversability.grid.centre_of(cells[self._rng.integers(len(cells))])
        return Viewpoint(place, wrap_angle(self._rng.uniform(0, 2 * np.pi)), True, 0.0)
