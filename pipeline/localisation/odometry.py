"""The interface of localisation, and localisation by the odometry alone, for comparison."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop closure: two keyframes that saw the same place.

    Attributes:
        first, second: numbers of the keyframes, the older one first.
        T_first_second: 4×4 pose of the second in the frame of the first, as registered.
    """

    first: int
    second: int
    T_first_second: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Keyframes:
    """What a later episode must know of keyframes to localise among them.

    Attributes:
        poses: (K, 4, 4) ``T_map_base``.
        ups: (K, 3) the vertical in the ``base_link`` of each keyframe.
        points: (N, 3) points of the surfaces seen, in the ``base_link`` of their keyframe, m.
        normals: (N, 3) of the points, of length 1.
        owner: (N,) int64 number of the keyframe that each point belongs to.
    """

    poses: NDArray[np.float64]
    ups: NDArray[np.float64]
    points: NDArray[np.floating]
    normals: NDArray[np.float64]
    owner: NDArray[np.int64]


class LostError(Exception):
    """The robot's pose is unknown; the message says why."""


class OdometryLocalisation:
    """Estimates the robot's pose at each frame; this class takes the pose from the odometry unchanged.

    Attributes:
        T_map_odom: 4×4 pose of ``odom`` in ``map`` by the newest frame; here the two frames are the same.
        loops: loop closures so far.
        may_err: whether the poses must be checked against the map.
    """

    may_err = False

    def __init__(self) -> None:
        self.T_map_odom = np.eye(4)
        self.loops: list[Loop] = []
        self._poses: NDArray[np.float64] = np.zeros((0, 4, 4))

    @property
    def poses(self) -> NDArray[np.float64]:
        """(K, 4, 4) ``T_map_base`` of every keyframe as now estimated."""
        return self._poses

    @property
    def is_contradicted(self) -> bool:
        """Whether registration of the newest frame contradicts the odometry more than slipping wheels can explain."""
        return False

    @property
    def is_blind(self) -> bool:
        """Whether the robot has driven too far without a registration to trust its odometry."""
        return False

    @property
    def agrees(self) -> bool | None:
        """Whether registration of the newest frame agrees with the odometry; None if it was not registered."""
        return None

    @property
    def overlap(self) -> float:
        """Share of the newest frame's points that were seen before; 1 if it was not registered."""
        return 1.0

    def localise(self, frame: Frame) -> NDArray[np.float64]:
        """4×4 pose of ``base_link`` in ``map`` at the time of the frame; raises LostError if it is unknown."""
        check_odometry(frame)
        return self.T_map_odom @ frame.T_odom_base

    def add(self, frame: Frame, T_map_base: NDArray[np.float64]) -> None:
        """Make a keyframe of the newest frame, at the pose that :meth:`localise` gave."""
        self._poses = np.concatenate([self._poses, T_map_base[None]])

    def optimise(self) -> None:
        """Correct the poses of all keyframes; here there is nothing to correct."""

    def set_down(self, T_map_base: NDArray[np.float64]) -> None:
        """Continue from the pose (4×4) to which the robot was carried; here the pose is ignored."""

    def trust(self) -> None:
        """Trust the odometry again where nothing could be registered, once the robot has looked around."""

    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the surfaces seen so far, m in ``map``; here none are kept."""
        return np.zeros((0, 3), np.float32)

    def keyframes(self) -> Keyframes:
        """All keyframes so far; here without points."""
        nothing = np.zeros((0, 3))
        return Keyframes(self.poses, self.poses[:, 2, :3], nothing, nothing, np.zeros(0, np.int64))

    def restore(self, keyframes: Keyframes) -> None:
        """Begin with the keyframes of an earlier episode, whose poses stay fixed."""
        self._poses = keyframes.poses


Localisation = OdometryLocalisation
"""The interface of localisation: this class, or its subclass :class:`pipeline.localisation.slam.Slam`."""


def check_odometry(frame: Frame) -> None:
    """Raises LostError if the odometry of a frame is not finite."""
    if not np.isfinite(frame.T_odom_base).all():
        raise LostError(f"the odometry at {frame.time:.2f} s is not finite")
