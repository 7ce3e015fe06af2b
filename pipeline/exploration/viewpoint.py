"""Viewpoints, the context in which the robot chooses one, and the interface of the strategies that do so."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Layer, Place, Places, Pose, Poses, Values
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import Traversability
from pipeline.frame import Frame
from pipeline.planning.pose_paths import PosePaths

Why = Literal["unseen", "person", "too_steep", "no_way"]


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A pose from which to look.

    Attributes:
        position: (2,) m, position of the robot in ``map``.
        heading: heading of the robot, rad.
        turn: whether the robot turns to the heading on arrival.
        gain: area of ground expected to be seen for the first time, plus the rewards of the viewpoint, m².
        seconds: expected time until the keyframe is taken, s; infinite if no path leads there, 0 if not computed.
        opens: whether the viewpoint's purpose is to show the cells that may block the path to ground that was seen.
        why: the reason for giving the viewpoint up, if it is given up:

            - ``unseen``: no keyframe showed the ground in view, or the cells that block the path to seen ground
            - ``person``: the robot would come too near to a person
            - ``too_steep``: slopes block the path
            - ``no_way``: something else blocks the path

        stands: whether the robot must stop at the viewpoint unless the drive itself shows enough. It must if the next
            drive depends on the view, or if only a keyframe there shows what the viewpoint is for.
    """

    position: Place
    heading: float
    turn: bool
    gain: float
    seconds: float = 0.0
    opens: bool = False
    stands: bool = False
    why: Why = "unseen"

    @property
    def is_reachable(self) -> bool:
        """Whether a path leads to the viewpoint."""
        return bool(np.isfinite(self.seconds))


class ViewpointRewards(Protocol):
    """Rewards for viewpoints, in addition to unseen ground."""

    @property
    def wanted(self) -> Sequence[object]:
        """The items to be looked at; empty if there are no rewards."""
        ...

    def gains(self, places: Places, bearings: Values) -> NDArray[np.float64]:
        """(N, M) m², rewards of keyframes at N positions on the ground, each with M headings (rad)."""
        ...

    def aim(self, place: Place, heading: float) -> None:
        """Remember that the next keyframe is meant for a position (3,) on the ground and a heading (rad)."""
        ...


@dataclass(frozen=True, eq=False)
class Context:
    """The robot's knowledge when it decides where to go.

    Attributes:
        frame: the newest frame.
        T_map_base: pose of the robot.
        measured: (nx, ny) float32 m, height of the ground where it was seen; NaN elsewhere.
        paths: cheapest paths from the pose at which the robot stands or will come to rest.
        poses: ``T_map_base`` of all keyframes, the newest last.
        rewards: rewards for viewpoints, in addition to unseen ground; None if there are none.
        driven: distance driven so far by odometry, m.
    """

    frame: Frame
    T_map_base: Pose
    measured: Layer
    paths: PosePaths
    poses: Poses
    rewards: ViewpointRewards | None = None
    driven: float = 0.0

    @property
    def traversability(self) -> Traversability:
        """The traversability of the ground."""
        return self.paths.traversability


class Strategy(Protocol):
    """A strategy that decides where to go; only the abstract methods must be overridden."""

    @abstractmethod
    def observe(self, context: Context) -> None:
        """Take the newest keyframe into account; called before any other method, up to three times per step."""
        ...

    @abstractmethod
    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The next viewpoint; None if this strategy has none. The call has no side effects."""
        ...

    @abstractmethod
    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember that the robot sets out for a viewpoint that this strategy has returned."""
        ...

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the drive to the last viewpoint has already shown the ground that the robot set out to see."""
        return False

    def leftovers(self, context: Context) -> list[Viewpoint]:
        """Viewpoints that would show more, worth the drive or not, and pieces of seen ground to which no path leads.

        The call has no side effects.
        """
        return []
