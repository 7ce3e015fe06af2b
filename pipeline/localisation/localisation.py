"""The interface of localisation methods, and the data that they return."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.arrays import Covariance, Directions, Indices, Places, Points, Pose, Poses, Values
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief
from pipeline.localisation.config import OdometryConfig
from pipeline.transforms import POSE_REQUIREMENT, are_poses


@dataclass(frozen=True, eq=False)
class LocalisedFrame:
    """A frame and the pose at which it was taken.

    Attributes:
        frame: the frame that was localised.
        T_map_base: pose of ``base_link`` at the frame's time.
        repeats: whether the frame adds nothing, because a keyframe at the same pose has seen all that the frame
            shows.
    """

    frame: Frame
    T_map_base: Pose
    repeats: bool = False

    @property
    def T_map_camera(self) -> Pose:
        """Pose of the camera at the frame's time."""
        return self.T_map_base @ self.frame.T_base_camera


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop closure: two keyframes that saw the same place.

    Attributes:
        first, second: indices of the keyframes, the older one first.
        T_first_second: registered pose of the second keyframe in the frame of the first.
    """

    first: int
    second: int
    T_first_second: Pose


@dataclass(frozen=True, eq=False)
class OdometryErrors:
    """Systematic errors of the odometry.

    Attributes:
        errors: (7,) systematic errors:

            - relative error of distance
            - relative error of rotation
            - distance from ``base_link`` forward to the centre of rotation, m
            - downhill slide in turns on a slope, m per rad turned, to be multiplied by the sine of the tilt
            - slide along the axle, in proportion to the component of gravity along the axle; in the same unit
            - slide of the point about which the robot turns, downhill along the robot's forward axis; in the same
              unit
            - bias of the yaw rate, rad/s

        covariance: (7, 7) covariance of the errors.
    """

    errors: Values
    covariance: Covariance

    @classmethod
    def expected(cls, config: OdometryConfig) -> "OdometryErrors":
        """The errors expected of a skid-steered robot that has not driven yet."""
        c = config
        slide, slide_sigmas = 3 * [c.slide], 3 * [c.slide_sigma]
        sigmas = [c.distance_scale_sigma, c.rotation_scale_sigma, c.centre_sigma, *slide_sigmas, c.bias_sigma]
        return cls(np.array([0.0, 0.0, 0.0, *slide, 0.0]), np.diag(np.square(sigmas)))


@dataclass(frozen=True, eq=False)
class SavedKeyframes:
    """The keyframe data with which a later run can localise the robot.

    Attributes:
        poses: ``T_map_base`` of each keyframe.
        ups: the vertical in each keyframe's ``base_link``.
        points: points of the surfaces seen, in the ``base_link`` of their keyframe.
        normals: surface normals at the points, in the same frame.
        owner: index of the keyframe that owns each point.
        odometry: the estimated systematic errors of the odometry.
    """

    poses: Poses
    ups: Directions
    points: Places | Points
    normals: Directions
    owner: Indices
    odometry: OdometryErrors


class LostError(Exception):
    """The robot's pose is unknown; the message states the reason."""


class Localisation(Protocol):
    """Estimates the robot's pose at each frame, and the poses of keyframes.

    Attributes:
        T_map_odom: pose of ``odom`` in ``map``, from the newest frame.
        loops: loop closures so far.
        needs_pose_check: whether the poses must be checked against the map.
        belief: belief about the robot's motion and position.
    """

    T_map_odom: Pose
    loops: list[Loop]
    needs_pose_check: bool
    belief: Belief

    @property
    def poses(self) -> Poses:
        """Current estimate of every keyframe's ``T_map_base``."""
        ...

    def localise(self, frame: Frame) -> LocalisedFrame:
        """Localise a new frame; raises LostError if its pose is unknown."""
        ...

    def add(self, localised: LocalisedFrame) -> None:
        """Make the newest frame, as returned by :meth:`localise`, a keyframe."""
        ...

    def continue_without_keyframe(self, localised: LocalisedFrame) -> None:
        """Continue from the newest frame, as returned by :meth:`localise`, without making it a keyframe."""
        ...

    def optimise(self) -> None:
        """Correct the poses of all keyframes."""
        ...

    def set_pose(self, T_map_base: Pose) -> None:
        """Continue from the pose to which the robot was carried."""
        ...

    def points(self) -> Points:
        """Points of the surfaces seen so far."""
        ...

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far."""
        ...

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Start with the keyframes of an earlier run, whose poses stay fixed."""
        ...


def check_odometry(frame: Frame) -> None:
    """Raise LostError if a frame's odometry, or the pose of its camera on the robot, is not a valid pose."""
    check_pose("odometry", frame.time, frame.T_odom_base)
    check_pose("camera pose", frame.time, frame.T_base_camera)


def check_pose(name: str, time: float, T: Pose) -> None:
    """Raise LostError if a matrix is not a valid pose; the message contains ``name`` and the time, s."""
    if not are_poses(T):
        raise LostError(f"the {name} at {time:.2f} s is not {POSE_REQUIREMENT}")
