"""A place to look from, and what the robot knows when it chooses one."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.frame import Frame
from pipeline.planning.pose_paths import PosePaths

ARRIVED = 0.15
"""m; a robot this close to a viewpoint or goal has reached it."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A place to look from.

    Attributes:
        position: (2,) m in ``map``.
        heading: rad.
        turn: whether the robot turns to the heading when it is there.
        gain: m² of ground expected to be seen for the first time, and the rewards of the viewpoint.
        seconds: expected until the keyframe is taken.
    """

    position: NDArray[np.float64]
    heading: float
    turn: bool
    gain: float
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Context:
    """What the robot knows when it decides where to go.

    Attributes:
        frame: the newest frame.
        T_map_base: 4×4 pose of the robot.
        measured: (nx, ny) float32 height of the ground where it was seen, m; NaN elsewhere.
        paths: cheapest ways from where the robot stands.
        poses: (K, 4, 4) ``T_map_base`` of all keyframes, the newest last.
    """

    frame: Frame
    T_map_base: NDArray[np.float64]
    measured: NDArray[np.float32]
    paths: PosePaths
    poses: NDArray[np.float64]

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive."""
        return self.paths.traversability


class Strategy(Protocol):
    """One way to decide where to go."""

    def observe(self, context: Context) -> None:
        """Take into account what the newest keyframe shows; called once a step, before anything is asked."""
        ...

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """Where to go next; None if this strategy has no viewpoint. The call changes nothing."""
        ...

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember that the robot sets out for a viewpoint that this strategy has named."""
        ...
