"""Viewpoints, what the robot knows when it chooses one, and the interface of strategies that choose."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Layer, Place, Places, Pose, Poses, Values
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import Traversability
from pipeline.frame import Frame
from pipeline.planning.pose_paths import PosePaths


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A place to look from.

    Attributes:
        position: (2,) m in ``map``.
        heading: rad.
        turn: whether the robot turns to the heading when it is there.
        gain: m² of ground expected to be seen for the first time, and the rewards of the viewpoint.
        seconds: expected until the keyframe is taken.
        falls: whether the gain assumes that unknown ground behind crests falls.
        opens: whether its purpose is to show what blocks the route to ground that was seen.
        stands: whether the robot must stop there, unless the drive itself shows enough, because its next drive
            depends on what it sees.
    """

    position: Place
    heading: float
    turn: bool
    gain: float
    seconds: float = 0.0
    falls: bool = True
    opens: bool = False
    stands: bool = False


class ViewpointRewards(Protocol):
    """Rewards that make a viewpoint worth a drive besides unseen ground."""

    @property
    def wanted(self) -> Sequence[object]:
        """What is to be seen; empty if there are no rewards."""
        ...

    def gains(self, places: Places, bearings: Values) -> NDArray[np.float64]:
        """(N, M) m², rewards of keyframes from N places on the ground along M bearings (rad)."""
        ...

    def aim(self, place: Place, heading: float) -> None:
        """Remember that the next keyframe is to be taken from a place (3,) on the ground along a heading (rad)."""
        ...


@dataclass(frozen=True, eq=False)
class Context:
    """What the robot knows when it decides where to go.

    Attributes:
        frame: the newest frame.
        T_map_base: of the robot.
        measured: float32 height of the ground where it was seen, m; NaN elsewhere.
        paths: cheapest ways from where the robot stands.
        poses: ``T_map_base`` of all keyframes, the newest last.
        rewards: of viewpoints, besides unseen ground; None for no such rewards.
        driven: m that the robot has driven so far, by its odometry.
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
        """Where the robot may drive."""
        return self.paths.traversability


class Strategy(Protocol):
    """A strategy that decides where to go; only abstract methods must be overridden."""

    @abstractmethod
    def observe(self, context: Context) -> None:
        """Take into account what the newest keyframe shows; called once a step, before any other method."""
        ...

    @abstractmethod
    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """Where to go next; None if this strategy has no viewpoint. The call changes nothing."""
        ...

    @abstractmethod
    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Remember that the robot sets out for a viewpoint that this strategy has named."""
        ...

    def is_shown(self, elevation_map: ElevationMap) -> bool:
        """Whether the drive to the last viewpoint has already shown what the robot set out for."""
        return False

    def leftovers(self, context: Context) -> list[Viewpoint]:
        """Viewpoints that would show more, whether or not they are worth the drive; the call changes nothing."""
        return []
