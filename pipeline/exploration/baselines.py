"""Baselines of exploration, behind the interface of :class:`pipeline.exploration.next_best_view.Exploration`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.exploration.next_best_view import Exploration
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.transforms import wrap_angle

ROBOT_SIZE = 0.25
"""m² of unseen ground, about a robot's footprint, that make a frontier worth visiting before smaller ones."""


class NearestFrontier(Exploration):
    """Drives to the nearest place from which unseen ground should come into view (Yamauchi 1997).

    There it looks where most should be seen. What counts as unseen, what the camera should show from where, and when
    to give up are the same as for the robot's own exploration; how much a view shows for the time that it costs, and
    the time for turning, do not count. As with Yamauchi, frontiers smaller than the robot come last.
    """

    def _worth(
        self, gains: NDArray[np.float64], distance: NDArray[np.float64], seconds: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        large = gains >= (ROBOT_SIZE if (gains >= ROBOT_SIZE).any() else self.config.min_gain)
        near = distance == np.where(large.any(axis=1), distance, np.inf).min()
        return np.where(large & near[:, None], gains, 0.0)


class RandomWalk(Exploration):
    """Looks in a random direction from a random place that is not far, until it has looked so often."""

    def __init__(self, seed: int, stride: float = 2.0, steps: int = 300):
        """``stride``: the way to the next place is no longer than this, m; ``steps``: after so many it ends."""
        super().__init__()
        self._rng = np.random.default_rng(seed)
        self._farthest, self._keyframes_left, self._draw = stride, steps, np.zeros(2)

    def observe(self, context: Context) -> None:
        """Draw where to go next."""
        self._keyframes_left -= 1
        self._draw = self._rng.random(2)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that was drawn; None at the end, and where the robot can drive nowhere."""
        near = context.traversability.turnable & (context.paths.cost <= self._farthest)
        cells = np.argwhere(near)
        if not len(cells) or self._keyframes_left < 0:
            return None
        place = context.traversability.grid.centre_of(cells[int(self._draw[0] * len(cells))])
        return Viewpoint(place, wrap_angle(2 * np.pi * self._draw[1]), True, 0.0)

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Nothing to remember."""
