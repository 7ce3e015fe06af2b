"""What localises a robot, and the odometry taken at its word, for comparison."""

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Keyframes:
    """What a later episode has to know of keyframes to find its place among them.

    Attributes:
        poses: (K, 4, 4) ``T_map_base``.
        ups: (K, 3) the vertical in each one's ``base_link``.
        points: (N, 3) of the surfaces that they saw, in their owner's ``base_link``, m.
        normals: (N, 3) of these, of length 1.
        owner: (N,) int64 number of the keyframe that each belongs to.
    """

    poses: NDArray[np.float64]
    ups: NDArray[np.float64]
    points: NDArray[np.floating]
    normals: NDArray[np.float64]
    owner: NDArray[np.int64]


class LostError(Exception):
    """The robot does not know where it is, and says why."""


class OdometryLocalisation:
    """Tells where the robot was when frames were taken; this one takes the odometry at its word.

    Attributes:
        T_map_odom: 4×4, where the odometry's origin is by the newest frame; here the two frames are one.
        loops: closed so far.
        may_err: whether its poses are to be checked against the map.
    """

    may_err = False

    def __init__(self) -> None:
        self.T_map_odom = np.eye(4)
        self.loops: list[Loop] = []
        self._poses: NDArray[np.float64] = np.zeros((0, 4, 4))

    @property
    def poses(self) -> NDArray[np.float64]:
        """(K, 4, 4) ``T_map_base`` of every keyframe, as it is now believed."""
        return self._poses

    @property
    def is_contradicted(self) -> bool:
        """Whether the newest frame fits only where no slip of wheels can have brought the robot."""
        return False

    @property
    def is_blind(self) -> bool:
        """Whether the robot has come farther than its odometry may be believed with nothing to register."""
        return False

    @property
    def overlap(self) -> float:
        """Share of the newest frame's points that were seen before; 1 if it was not registered."""
        return 1.0

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` at the time of the frame; LostError where it cannot be told."""
        check_odometry(frame)
        return self.T_map_odom @ frame.T_odom_base

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> None:
        """Make a keyframe of the newest frame, at the pose that :meth:`localise` gave."""
        self._poses = np.concatenate([self._poses, T_map_base[None]])

    def optimise(self) -> None:
        """Correct the poses of all keyframes; here there is nothing to correct."""

    def set_down(self, T_map_base: NDArray[np.float64]) -> None:
        """Take it that the robot was carried to a pose (4×4); here the odometry is taken at its word all the same."""

    def trust(self) -> None:
        """The robot has looked around, and goes on by its odometry where there was nothing to register."""

    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the surfaces seen so far, m in ``map``; here none are kept."""
        return np.zeros((0, 3), np.float32)

    def keyframes(self) -> Keyframes:
        """All so far; here without points."""
        nothing = np.zeros((0, 3))
        return Keyframes(self.poses, self.poses[:, 2, :3], nothing, nothing, np.zeros(0, np.int64))

    def restore(self, keyframes: Keyframes) -> None:
        """Begin with those of an earlier episode, which stay where they are."""
        self._poses = keyframes.poses


Localisation = OdometryLocalisation
"""What localises a robot: this, or :class:`pipeline.localisation.slam.Slam`."""


def check_odometry(frame: Frame) -> None:
    """Raises LostError if the odometry of a frame is not finite."""
    if not np.isfinite(frame.T_odom_base).all():
        raise LostError(f"the odometry at {frame.time:.2f} s is not finite")
