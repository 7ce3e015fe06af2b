"""The interface of localisation."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief
from pipeline.transforms import are_poses

KEYFRAME_WAY, KEYFRAME_TURN = 0.3, np.deg2rad(15)
"""m and rad that the robot drives or turns from one keyframe to the next; poses closer than that count as one."""
STILL_WAY, STILL_TURN = 0.02, np.deg2rad(2)
"""m and rad; a robot that moves less stands."""


@dataclass(frozen=True, eq=False)
class Localised:
    """A frame and where it was taken.

    Attributes:
        frame: what the camera saw.
        T_map_base: pose of ``base_link`` at its time.
        repeats: whether the frame adds nothing: a keyframe at its pose saw all that it shows.
    """

    frame: Frame
    T_map_base: Pose
    repeats: bool = False

    @property
    def T_map_camera(self) -> Pose:
        """Pose of the camera at its time."""
        return self.T_map_base @ self.frame.T_base_camera


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
class OdometryErrors:
    """Systematic errors of an odometry.

    Attributes:
        errors: (5,) relative errors of the way and of the turn, the centre of turns ahead of ``base_link`` in m, the
            slide downhill in m per rad turned and times the sine of the tilt, and the error of the yaw rate in rad/s.
        covariance: (5, 5).
    """

    errors: NDArray[np.float64]
    covariance: NDArray[np.float64]


UNKNOWN_ODOMETRY = OdometryErrors(
    np.array([0.0, 0.0, 0.0, 0.4, 0.0]), np.diag(np.square([0.02, 0.005, 0.02, 0.2, 5e-5]))
)
"""What is known of a skid-steered robot before it drives: by tyres, data sheets of gyros, and slides on wood."""


@dataclass(frozen=True, eq=False)
class SavedKeyframes:
    """What a later episode must know of keyframes to localise among them.

    Attributes:
        poses: (K, 4, 4) ``T_map_base``.
        ups: (K, 3) the vertical in the ``base_link`` of each keyframe.
        points: (N, 3) points of the surfaces seen, in the ``base_link`` of their keyframe, m.
        normals: (N, 3) of the points, of length 1.
        owner: (N,) int64 number of the keyframe that each point belongs to.
        odometry: what was learnt of the odometry.
    """

    poses: NDArray[np.float64]
    ups: NDArray[np.float64]
    points: NDArray[np.floating]
    normals: NDArray[np.float64]
    owner: NDArray[np.int64]
    odometry: OdometryErrors


class LostError(Exception):
    """The robot's pose is unknown; the message says why."""


class Localisation(Protocol):
    """Estimates the robot's pose at each frame, and the poses of keyframes.

    Attributes:
        T_map_odom: 4×4 pose of ``odom`` in ``map`` by the newest frame.
        loops: loop closures so far.
        may_err: whether the poses must be checked against the map.
        belief: of the robot's motion and place.
    """

    T_map_odom: NDArray[np.float64]
    loops: list[Loop]
    may_err: bool
    belief: Belief

    @property
    def poses(self) -> NDArray[np.float64]:
        """(K, 4, 4) ``T_map_base`` of every keyframe as now estimated."""
        ...

    def localise(self, frame: Frame) -> Localised:
        """A new frame and where it was taken; raises LostError if that is unknown."""
        ...

    def add(self, localised: Localised) -> None:
        """Make a keyframe of the newest frame, as :meth:`localise` gave it."""
        ...

    def pass_by(self, localised: Localised) -> None:
        """Go on from the newest frame, as :meth:`localise` gave it, without a keyframe."""
        ...

    def optimise(self) -> None:
        """Correct the poses of all keyframes."""
        ...

    def set_down(self, T_map_base: NDArray[np.float64]) -> None:
        """Continue from the pose (4×4) to which the robot was carried."""
        ...

    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the surfaces seen so far, m in ``map``."""
        ...

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far."""
        ...

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Begin with the keyframes of an earlier episode, whose poses stay fixed."""
        ...


def check_odometry(frame: Frame) -> None:
    """Raises LostError if the odometry of a frame, or the place of its camera on the robot, is no pose."""
    check_pose("odometry", frame.time, frame.T_odom_base)
    check_pose("camera's place", frame.time, frame.T_base_camera)


def check_pose(what: str, time: float, T: NDArray[np.float64]) -> None:
    """Raises LostError, with ``what`` and the time, s, if a (4, 4) matrix is no pose."""
    if not are_poses(T):
        raise LostError(f"the {what} at {time:.2f} s is not finite, or too far away")
