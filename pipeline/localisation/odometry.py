"""Localisation with odometry alone, for comparison."""

from dataclasses import replace

import numpy as np

from pipeline.arrays import Points, Pose, Poses
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import (
    Localisation,
    LocalisedFrame,
    Loop,
    OdometryErrors,
    SavedKeyframes,
    check_odometry,
)


class OdometryLocalisation(Localisation):
    """Takes the robot's pose from its odometry unchanged.

    Attributes:
        T_map_odom: pose of ``odom`` in ``map``; here the two frames are the same.
        loops: loop closures; here always empty.
        needs_pose_check: whether the poses must be checked against the map; here False.
        belief: belief about the robot's motion and position; here always certain that the robot moves as its odometry
            reports.
    """

    needs_pose_check = False

    def __init__(self, *, config: LocalisationConfig = LocalisationConfig()) -> None:
        self.T_map_odom = np.eye(4)
        self.loops: list[Loop] = []
        self.belief = Belief(config.belief)
        self._poses, nothing = np.zeros((0, 4, 4)), np.zeros((0, 3))
        odometry = OdometryErrors.expected(config.odometry)
        self._loaded = SavedKeyframes(self._poses, nothing, nothing, nothing, np.zeros(0, np.int64), odometry)

    @property
    def poses(self) -> Poses:
        """Current estimate of every keyframe's ``T_map_base``."""
        return self._poses

    def localise(self, frame: Frame) -> LocalisedFrame:
        """Localise a new frame; raises LostError if its pose is unknown."""
        check_odometry(frame)
        return LocalisedFrame(frame, self.T_map_odom @ frame.T_odom_base)

    def add(self, localised: LocalisedFrame) -> None:
        """Make the newest frame, as returned by :meth:`localise`, a keyframe."""
        self._poses = np.concatenate([self._poses, localised.T_map_base[None]])

    def continue_without_keyframe(self, localised: LocalisedFrame) -> None:
        """Continue from the newest frame without a keyframe; here a no-op, because no frame repeats a keyframe."""

    def optimise(self) -> None:
        """Correct the poses of all keyframes; here there is nothing to correct."""

    def set_pose(self, T_map_base: Pose) -> None:
        """Continue from the pose to which the robot was carried; here the pose is ignored."""

    def points(self) -> Points:
        """Points of the surfaces seen so far; here none are kept."""
        return np.zeros((0, 3), np.float32)

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far; only those of an earlier run have points."""
        ups = np.concatenate([self._loaded.ups, self.poses[len(self._loaded.ups) :, 2, :3]])
        return replace(self._loaded, poses=self.poses, ups=ups)

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Start with the keyframes of an earlier run, whose poses stay fixed."""
        self._poses, self._loaded = keyframes.poses, keyframes
