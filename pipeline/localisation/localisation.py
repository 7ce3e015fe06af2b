"""The interface of localisation."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Covariance, Directions, Indices, Places, Points, Pose, Poses, Values
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief
from pipeline.localisation.config import OdometryConfig
from pipeline.transforms import are_poses


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
        T_first_second: pose of the second in the frame of the first, as registered.
    """

    first: int
    second: int
    T_first_second: Pose


@dataclass(frozen=True, eq=False)
class OdometryErrors:
    """Systematic errors of an odometry.

    Attributes:
        errors: (5,) relative errors of the way and of the turn, the centre of turns ahead of ``base_link`` in m, the
            slide downhill in m per rad turned and times the sine of the tilt, and the error of the yaw rate in rad/s.
        covariance: (5, 5).
    """

    errors: Values
    covariance: Covariance

    @classmethod
    def expected(cls, config: OdometryConfig) -> "OdometryErrors":
        """Those of a skid-steered robot that has not yet driven."""
        c = config
        sigmas = [c.way_error_sigma, c.turn_error_sigma, c.centre_sigma, c.slide_sigma, c.bias_sigma]
        return cls(np.array([0.0, 0.0, 0.0, c.slide, 0.0]), np.diag(np.square(sigmas)))


@dataclass(frozen=True, eq=False)
class SavedKeyframes:
    """What a later run needs of keyframes to localise among them.

    Attributes:
        poses: ``T_map_base``.
        ups: the vertical in the ``base_link`` of each keyframe.
        points: of the surfaces seen, in the ``base_link`` of their keyframe.
        normals: of the points.
        owner: number of the keyframe that each point belongs to.
        odometry: what was learnt of the odometry.
    """

    poses: Poses
    ups: Directions
    points: Places | Points
    normals: Directions
    owner: Indices
    odometry: OdometryErrors


class LostError(Exception):
    """The robot's pose is unknown; the message says why."""


class Localisation(Protocol):
    """Estimates the robot's pose at each frame, and the poses of keyframes.

    Attributes:
        T_map_odom: by the newest frame.
        loops: loop closures so far.
        may_err: whether the poses must be checked against the map.
        belief: of the robot's motion and place.
    """

    T_map_odom: Pose
    loops: list[Loop]
    may_err: bool
    belief: Belief

    @property
    def poses(self) -> Poses:
        """``T_map_base`` of every keyframe as now estimated."""
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

    def set_down(self, T_map_base: Pose) -> None:
        """Continue from the pose to which the robot was carried."""
        ...

    def points(self) -> Points:
        """Points of the surfaces seen so far."""
        ...

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far."""
        ...

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Begin with the keyframes of an earlier run, whose poses stay fixed."""
        ...


def check_odometry(frame: Frame) -> None:
    """Raises LostError if the odometry of a frame, or the place of its camera on the robot, is no pose."""
    check_pose("odometry", frame.time, frame.T_odom_base)
    check_pose("camera's place", frame.time, frame.T_base_camera)


def check_pose(what: str, time: float, T: Pose) -> None:
    """Raises LostError, with ``what`` and the time, s, if a matrix is no pose."""
    if not are_poses(T):
        raise LostError(f"the {what} at {time:.2f} s is not finite, or too far away")
