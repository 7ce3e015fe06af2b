"""Whether the robot is where it thinks, and where it is if it was carried elsewhere."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import Traversability
from pipeline.frame import Frame
from pipeline.localisation.agreement import Agreement, agreement, change
from pipeline.localisation.belief import LEANED, MotionState
from pipeline.localisation.localisation import KEYFRAME_TURN, KEYFRAME_WAY, Localisation, LostError
from pipeline.localisation.relocalisation import Relocalisation
from pipeline.mapper import Mapper
from pipeline.navigation.navigator import Halt, Navigator
from pipeline.transforms import inverse, yaw_of

LOOKS = 8
"""Number of frames that a robot takes around itself when its pose is in doubt."""


class PoseCheck:
    """Compares frames with the map; where they disagree, the robot looks around until it knows its pose.

    Attributes:
        relocalised: number of times that the robot was localised anew after it was carried.
        T_odom_expected: 4×4 pose where the last step or drive left the robot; None if it was kidnapped.
    """

    def __init__(self, navigator: Navigator, mapper: Mapper, sense: Callable[[], Frame]) -> None:
        """``sense``: takes a frame where the robot stands."""
        self.relocalised = 0
        self.T_odom_expected: NDArray[np.float64] | None = None
        self._navigator, self._mapper, self._sense = navigator, mapper, sense

    def confirmed(self, frame: Frame, last: Frame | None) -> Frame:
        """The newest frame, once the robot has looked around as much as it needs to know its pose.

        Args:
            frame: the newest so far.
            last: the one before it; None for the first.

        Raises:
            LostError: the pose remains in doubt.
        """
        frame = self._confirm(frame, last)
        return frame if self._localisation.belief.knows_place and not self._is_lost else self._find_place(frame)

    def compare(self, frame: Frame, last: Frame | None = None, is_driving: bool = False) -> None:
        """Believe what a frame tells of the robot's place, also beside the one before it if the wheels stood since.

        A view that changed is no chance because another place looks as the map has this one, so both are one
        observation; one that did not change only tells that the robot was not carried since. On a drive the camera
        passes what is too near for it, so tiles without a return tell nothing.
        """
        if not self._localisation.may_err:
            return
        found, changed = self._agreement(frame), None if last is None else change(frame, last)
        found = found._replace(expected=found.known) if is_driving else found
        if changed is not None and changed.shows_another_place:
            found = Agreement.of([found, changed])
        self._localisation.belief.observe(found.log_likelihoods)

    def doubt(self, halt: Halt, traversability: Traversability) -> None:
        """Doubt the pose, or the map, after a halt of a robot that leaned too far where no ramp is mapped nearby."""
        if not traversability.has_ramp(halt.T_map_base[:2, 3]):
            self._localisation.belief.observe(LEANED)

    def expects(self, frame: Frame) -> bool:
        """Whether the map has surfaces within the camera's reach where a frame was taken."""
        return self._agreement(frame).tells

    def was_set_down(self, frame: Frame) -> bool:
        """Whether the robot is elsewhere than its drive ended, or has just begun; if so, assume flat ground there."""
        last, self.T_odom_expected = self.T_odom_expected, frame.T_odom_base
        is_elsewhere = last is None or bool(np.linalg.norm(frame.T_odom_base[:3, 3] - last[:3, 3]) > KEYFRAME_WAY)
        if is_elsewhere:
            self._mapper.assume_ground(self._mapper.localise(frame))
        return is_elsewhere

    @property
    def _localisation(self) -> Localisation:
        return self._mapper.localisation

    @property
    def _is_lost(self) -> bool:
        """Whether the robot has yet to be localised in the map of an earlier episode."""
        return self._localisation.may_err and 0 < len(self._mapper.keyframes) == self._mapper.keyframes.loaded

    def _confirm(self, frame: Frame, last: Frame | None) -> Frame:
        """Look around until it is clear whether the robot's pose is right: the newest frame."""
        belief = self._localisation.belief
        if self._is_lost or not self._localisation.may_err:
            return frame
        self.compare(frame, last)
        for _ in range(LOOKS):
            if belief.knows_place or belief.is_sure_of(MotionState.CARRIED) or not self._turn():
                break
            frame = self._sense()
            self.compare(frame)
        return frame

    def _turn(self) -> bool:
        """Turn by as much as shows the next part of the surroundings; False if that is impossible."""
        return self._navigator.turn(2 * np.pi / LOOKS)

    def _agreement(self, frame: Frame) -> Agreement:
        T_map_camera = self._mapper.localise(frame) @ frame.T_base_camera
        return agreement(frame, T_map_camera, self._mapper.metric_map)

    def _find_place(self, frame: Frame) -> Frame:
        """Look around until the robot is localised; returns the newest frame."""
        mapper, relocalisation = self._mapper, Relocalisation(self._navigator.robot.model)
        for _ in range(LOOKS):
            relocalisation.add(frame)
            T = relocalisation.find(mapper.metric_map, mapper.elevation_map, mapper.localisation.points())
            if T is not None:
                return self._go_on(frame, T)
            if not self._turn():
                break
            frame = self._sense()
            self.compare(frame)
        if not self._is_lost and self._localisation.belief.knows_place:
            # The frames fit the map except for something new, or something that the robot has driven through.
            return self._go_on(frame, mapper.localise(frame))
        raise LostError("the camera shows what the map does not, and no place fits for sure")

    def _go_on(self, frame: Frame, T_map_base: NDArray[np.float64]) -> Frame:
        """Trust a 4×4 pose; if the robot's pose was another one, the robot was carried or set down there."""
        move = inverse(self._mapper.localise(frame)) @ T_map_base
        self.T_odom_expected = frame.T_odom_base
        self._localisation.belief.restart()
        if self._is_lost or np.linalg.norm(move[:3, 3]) > KEYFRAME_WAY or abs(yaw_of(move)) > KEYFRAME_TURN:
            self._localisation.set_down(T_map_base)
            self.relocalised += 1
            self.T_odom_expected = None
        return frame
