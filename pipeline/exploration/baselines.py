"""Baselines of exploration, which implement :class:`pipeline.exploration.viewpoint.Strategy`."""

import numpy as np
from numpy.typing import NDArray

from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint
from pipeline.robot import RobotModel
from pipeline.transforms import wrap_angle


class NearestFrontier(NextBestView):
    """Drives to the cheapest position from which unseen ground is expected to be visible (Yamauchi 1997).

    The heading there is the one with the greatest gain. Unseen ground, the ground that a keyframe can show, and
    given-up cells are defined as in :class:`NextBestView`, but gain per second and the time of the final turn are
    ignored. As in Yamauchi's method, frontiers smaller than the robot are visited last.
    """

    takes_rewards = False

    def scores(self, gains: NDArray[np.float64], seconds: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 16) m², gains at the nearest position that is worth the drive, 0 elsewhere; see the base class."""
        good = gains >= self.required_gain(seconds)
        large = good & (gains >= self._robot.length * self._robot.width)
        good = large if large.any() else good
        distance = seconds.min(axis=1)
        near = distance == np.where(good.any(axis=1), distance, np.inf).min()
        return np.where(good & near[:, None], gains, 0.0)


class RandomWalk(Strategy):
    """Takes a given number of keyframes with random headings at random positions nearby."""

    def __init__(self, robot: RobotModel, seed: int = 0, stride: float = 2.0, steps: int = 300):
        """``stride``: maximum length of the path to the next position, m; ``steps``: number of keyframes to take."""
        self._rng, self._draw = np.random.default_rng(seed), np.zeros(2)
        self._max_seconds, self._steps_left = stride / robot.speed, steps
        self._keyframe_count = 0

    def observe(self, context: Context) -> None:
        """Count a step if there is a new keyframe, and draw the random numbers that determine the next viewpoint."""
        if len(context.poses) > self._keyframe_count:
            self._keyframe_count = len(context.poses)
            self._steps_left -= 1
            self._draw = self._rng.random(2)

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The viewpoint that was drawn; None after the last step, or if the robot cannot drive anywhere."""
        cells = np.argwhere(context.traversability.turnable & (context.paths.cost <= self._max_seconds))
        if not len(cells) or self._steps_left < 0:
            return None
        place = context.traversability.grid.centre_of(cells[int(self._draw[0] * len(cells))])
        return Viewpoint(place, wrap_angle(2 * np.pi * self._draw[1]), True, 0.0)

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Do nothing, because there is nothing to remember."""
