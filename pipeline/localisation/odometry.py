"""What localises a robot, and the odometry taken at its word, for comparison."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame


@dataclass(frozen=True, eq=False)
class Loop:
    """A place that was met again.

    Attributes:
        first, second: numbers of the keyframes, the older one first.
        T_first_second: 4×4 pose of the second in the frame of the first, as registered.
    """

    first: int
    second: int
    T_first_second: NDArray[np.float64]


class Localisation(Protocol):
    """Tells where the robot was when frames were taken.

    Attributes:
        T_map_odom: 4×4, where the odometry's origin is by the newest frame.
        poses: (K, 4, 4) ``T_map_base`` of the keyframes, as they are now believed.
        loops: closed so far.
    """

    T_map_odom: NDArray[np.float64]
    loops: list[Loop]

    @property
    def poses(self) -> NDArray[np.float64]:
        """Of every keyframe."""
        ...

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` at the time of the frame."""
        ...

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> None:
        """Make a keyframe of the newest frame, at the pose that :meth:`localise` gave."""
        ...

    def optimise(self) -> None:
        """Correct the poses of all keyframes."""
        ...


class OdometryLocalisation:
    """Takes the odometry at its word: ``map`` and ``odom`` are one frame, and no pose is ever corrected."""

    def __init__(self) -> None:
        self.T_map_odom = np.eye(4)
        self.loops: list[Loop] = []
        self.poses: NDArray[np.float64] = np.zeros((0, 4, 4))

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` at the time of the frame."""
        return self.T_map_odom @ frame.T_odom_base

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> None:
        """Remember the pose of a keyframe."""
        self.poses = np.concatenate([self.poses, T_map_base[None]])

    def optimise(self) -> None:
        """Do nothing."""
