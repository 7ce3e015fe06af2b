"""Whether the robot is where it thinks, and where it is if it was carried elsewhere.

Nothing here moves the robot: a check that needs another view asks for it, and the caller turns the robot.
"""

from collections.abc import Generator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Pose
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.frame import Frame
from pipeline.keyframes import Keyframes
from pipeline.localisation.agreement import Agreement, agreement, change
from pipeline.localisation.belief import Belief, MotionState
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import Localisation, Localised, LostError
from pipeline.localisation.relocalisation import Relocalisation
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.transforms import angle_of, inverse, yaw_of


class Confirmed(NamedTuple):
    """A pose that can be relied on.

    Attributes:
        localised: the newest frame.
        was_carried: whether the robot was carried to there; None if its pose was never in doubt.
    """

    localised: Localised
    was_carried: bool | None


Views = Generator[float, Localised | None, Confirmed]
"""Yields angles, rad, to turn by, and takes what the robot sees then; None if it could not turn."""


class PoseCheck:
    """Compares frames with the map; where they disagree, it asks for other views until it knows the pose.

    Attributes:
        relocalised: number of times that the robot was localised anew after it was carried.
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
        self._metric_map, self._elevation_map, self._all = metric_map, elevation_map, config
        self._has_seen = False
        self._T_odom_unseen: list[Pose] = []  # of the newest frames, which show nothing

    def confirm(self, localised: Localised, last: Frame | None) -> Views:
        """Ask for views until it is clear where the robot is.

        Args:
            localised: the newest frame so far.
            last: the one before it; None for the first.

        Raises:
            LostError: the pose remains in doubt.
        """
        localised = yield from self._compared(localised, last)
        if self._belief.knows_place and not self._is_lost:
            return Confirmed(localised, None)
        return (yield from self._find_place(localised))

    def compare(self, localised: Localised, last: Frame | None = None, is_driving: bool = False) -> None:
        """Weigh what a frame says about the robot's place, compared with the one before it if the wheels stood since.

        A view that changed is no coincidence because another place looks as the map has this one, so both are one
        observation; one that did not change only says that the robot was not carried since. On a drive the camera
        passes what is too near for it, so tiles without a return say nothing.
        """
        if not self._localisation.may_err:
            return
        belief, config = self._belief, self._belief.config
        found, changed = self._agreement(localised), None if last is None else change(localised.frame, last, config)
        found = found._replace(expected=found.known) if is_driving else found
        if changed is not None and changed.shows_another_place(config):
            found = Agreement.of([found, changed])
        belief.observe(found.log_likelihoods(config))

    def doubt(self) -> None:
        """Doubt the pose, or the map, because the robot leaned too far with no mapped ramp nearby."""
        self._belief.observe_lean()

    def check_depth(self, localised: Localised) -> None:
        """Raise LostError if nothing was seen in a turn, or on a way on which what is too near comes into view.

        A frame counts if the map has something there to be seen, or if nothing at all was seen yet.
        """
        frame = localised.frame
        if frame.returns.any():
            self._has_seen = True
            self._T_odom_unseen.clear()
        elif not self._has_seen or self._agreement(localised).expects_enough(self._belief.config):
            self._T_odom_unseen.append(frame.T_odom_base)
        moves = [inverse(a) @ b for a, b in pairwise(self._T_odom_unseen)]
        way = sum(np.linalg.norm(T[:3, 3]) for T in moves)
        if way > frame.sensor.nearest or sum(map(angle_of, moves)) > self._config.blind_turn:
            raise LostError(
                f"at {frame.time:.2f} s the camera has measured no depth for {len(moves) + 1} frames in a row"
            )

    @property
    def _belief(self) -> Belief:
        return self._localisation.belief

    @property
    def _is_lost(self) -> bool:
        """Whether the robot has yet to be localised in the map of an earlier episode."""
        return self._localisation.may_err and 0 < len(self._keyframes) == self._keyframes.loaded

    @property
    def _next_view(self) -> float:
        return 2 * np.pi / self._config.looks

    def _agreement(self, localised: Localised) -> Agreement:
        return agreement(localised.frame, localised.T_map_camera, self._metric_map, self._belief.config)

    def _compared(self, localised: Localised, last: Frame | None) -> Generator[float, Localised | None, Localised]:
        """Compare views until it is clear whether the robot's pose is right: the newest frame."""
        belief = self._belief
        if self._is_lost or not self._localisation.may_err:
            return localised
        self.compare(localised, last)
        for _ in range(self._config.looks):
            if belief.knows_place or belief.is_sure_of(MotionState.CARRIED):
                break
            if (view := (yield self._next_view)) is None:
                break
            localised = view
            self.compare(localised)
        return localised

    def _find_place(self, localised: Localised) -> Views:
        """Gather views until the robot is localised."""
        relocalisation = Relocalisation(self._robot, config=self._all)
        for _ in range(self._config.looks):
            relocalisation.add(localised.frame)
            T = relocalisation.find(self._metric_map, self._elevation_map, self._localisation.points())
            if T is not None:
                return self._go_on(localised, T)
            if (view := (yield self._next_view)) is None:
                break
            localised = view
            self.compare(localised)
        if not self._is_lost and self._belief.knows_place:
            # The frames fit the map except for something new, or something that the robot has driven through.
            return self._go_on(localised, localised.T_map_base)
        raise LostError("the camera view does not match the map, and no other place matches reliably")

    def _go_on(self, localised: Localised, T_map_base: Pose) -> Confirmed:
        """Rely on a pose; if it differs from the robot's pose, the robot was carried or set down there."""
        move, config = inverse(localised.T_map_base) @ T_map_base, self._config
        is_far = np.linalg.norm(move[:3, 3]) > config.carried_way or abs(yaw_of(move)) > config.carried_turn
        self._belief.restart()
        if not (self._is_lost or is_far):
            return Confirmed(localised, was_carried=False)
        self._localisation.set_down(T_map_base)
        self.relocalised += 1
        return Confirmed(self._localisation.localise(localised.frame), was_carried=True)
