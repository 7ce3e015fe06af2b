"""Checks whether the robot is at its estimated pose, and relocalises the robot if it was carried elsewhere.

This module does not move the robot: a check that needs another view requests it from its caller.
"""

from collections.abc import Callable
from itertools import pairwise
from math import tau
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Pose
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.keyframes import Keyframes
from pipeline.localisation.agreement import Agreement, agreement, agreement_with_previous
from pipeline.localisation.belief import Belief, MotionState
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import Localisation, LocalisedFrame, LostError
from pipeline.localisation.relocalisation import Relocalisation
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import angle_of, inverse, yaw_of

MAX_BLIND_TURN = tau
"""Rotation, rad, after which a camera without any returns, although the map predicts some, has failed."""


class ConfirmedPose(NamedTuple):
    """A pose that is known to be right.

    Attributes:
        localised: the newest frame and its pose.
        was_carried: whether the robot was carried to the pose; None if its pose was never in doubt.
    """

    localised: LocalisedFrame
    was_carried: bool | None


TurnRobot = Callable[[float], LocalisedFrame | None]
"""Turns the robot by an angle, rad, and returns the localised next frame; None if the robot could not turn."""


class PoseCheck:
    """Compares frames with the map; if they disagree, it requests other views until the pose is known.

    Attributes:
        relocalised: number of times that the robot was relocalised after being carried.
    """

    def __init__(
        self,
        localisation: Localisation,
        metric_map: MetricMap,
        elevation_map: ElevationMap,
        keyframes: Keyframes,
        robot: RobotModel,
        config: LocalisationConfig,
    ) -> None:
        self.relocalised = 0
        self._localisation, self._keyframes, self._robot, self._config = (
            localisation,
            keyframes,
            robot,
            config.pose_check,
        )
        self._metric_map, self._elevation_map, self._localisation_config = metric_map, elevation_map, config
        self._has_seen = False
        self._T_odom_unseen: list[Pose] = []  # odometry poses of the latest frames without returns

    def confirm(self, localised: LocalisedFrame, last: Frame | None, turn: TurnRobot) -> ConfirmedPose:
        """Look around until it is clear where the robot is.

        Args:
            localised: the newest frame so far.
            last: the frame before it; None for the first.
            turn: turns the robot for another view.

        Raises:
            LostError: the pose remains in doubt.
        """
        # Compare views with the map until it is clear whether the estimated pose is right.
        if self._localisation.needs_pose_check and not self._is_lost:
            self.compare(localised, last)
            for _ in range(self._config.views_per_turn):
                if self._belief.knows_place or self._belief.is_sure_of(MotionState.CARRIED):
                    break
                if (view := turn(self._view_angle)) is None:
                    break
                localised = view
                self.compare(localised)
        if self._belief.knows_place and not self._is_lost:
            return ConfirmedPose(localised, None)
        # The pose is wrong or unknown: collect views until the robot is found on the map.
        relocalisation = Relocalisation(self._robot, config=self._localisation_config)
        for _ in range(self._config.views_per_turn):
            relocalisation.add(localised.frame)
            T = relocalisation.find(self._metric_map, self._elevation_map, self._localisation.points())
            if T is not None:
                return self._accept(localised, T)
            if (view := turn(self._view_angle)) is None:
                break
            localised = view
            self.compare(localised)
        if not self._is_lost and self._belief.knows_place:
            # The frames fit the map except for something new, or something that the robot has driven through.
            return self._accept(localised, localised.T_map_base)
        raise LostError("the camera view does not match the map, and no other place matches reliably")

    def compare(self, localised: LocalisedFrame, last: Frame | None = None, is_driving: bool = False) -> None:
        """Update the belief by comparing a frame with the map and, if the wheels were still, with the last frame.

        A changed view shows that the robot was carried even if the new place looks as the map predicts, so both
        comparisons form one observation. An unchanged view shows only that the robot was not carried since the last
        frame. During a drive, the camera passes surfaces that are too near to measure, so tiles without a return are
        ignored.
        """
        if not self._localisation.needs_pose_check:
            return
        belief, config = self._belief, self._belief.config
        found = self._agreement(localised)
        changed = None if last is None else agreement_with_previous(localised.frame, last)
        found = found._replace(expected=found.known) if is_driving else found
        if changed is not None and changed.shows_another_place(config):
            found = Agreement.of([found, changed])
        belief.observe(found.log_likelihoods(config))

    def doubt(self) -> None:
        """Doubt the pose or the map, because the robot has leaned too far with no mapped ramp nearby."""
        self._belief.observe_lean()

    def check_depth(self, localised: LocalisedFrame) -> None:
        """Raise LostError if the camera measures no depth in a full turn or on a drive longer than its near limit.

        Until the camera has measured any depth, all frames count. Afterwards, a frame without returns counts only if
        the map predicts enough returns; any other frame starts the count again.
        """
        frame = localised.frame
        has_returns = bool(frame.returns.any())
        self._has_seen |= has_returns
        if has_returns or (self._has_seen and not self._agreement(localised).expects_enough):
            self._T_odom_unseen.clear()
        else:
            self._T_odom_unseen.append(frame.T_odom_base)
        moves = [inverse(a) @ b for a, b in pairwise(self._T_odom_unseen)]
        way = sum(np.linalg.norm(T[:3, 3]) for T in moves)
        if way > frame.sensor.nearest or sum(map(angle_of, moves)) > MAX_BLIND_TURN:
            raise LostError(
                f"up to {frame.time:.2f} s, the camera measured no depth in {len(moves) + 1} frames in a row"
            )

    @property
    def _belief(self) -> Belief:
        return self._localisation.belief

    @property
    def _is_lost(self) -> bool:
        """Whether the robot has yet to be localised in the map of an earlier episode."""
        return self._localisation.needs_pose_check and 0 < len(self._keyframes) == self._keyframes.loaded_count

    @property
    def _view_angle(self) -> float:
        """Angle by which the robot turns for another view, rad."""
        return 2 * np.pi / self._config.views_per_turn

    def _agreement(self, localised: LocalisedFrame) -> Agreement:
        return agreement(localised.frame, localised.T_map_camera, self._metric_map)

    def _accept(self, localised: LocalisedFrame, T_map_base: Pose) -> ConfirmedPose:
        """Accept a pose; if it differs from the estimated one, the robot was carried or set down there."""
        move, config = inverse(localised.T_map_base) @ T_map_base, self._config
        distance, turn = np.linalg.norm(move[:3, 3]), abs(yaw_of(move))
        is_far = distance > config.min_carried_distance or turn > config.min_carried_turn
        self._belief.restart()
        if not (self._is_lost or is_far):
            return ConfirmedPose(localised, was_carried=False)
        self._localisation.set_pose(T_map_base)
        self.relocalised += 1
        return ConfirmedPose(self._localisation.localise(localised.frame), was_carried=True)
