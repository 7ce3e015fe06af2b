"""Whether the robot is where it thinks, and where it is if it was carried elsewhere."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.localisation.agreement import TELLING_TILES, Agreement, agreement, shows_another_place
from pipeline.localisation.localisation import KEYFRAME_TURN, KEYFRAME_WAY, LostError
from pipeline.localisation.relocalisation import LEAST_FRAMES, Relocalisation
from pipeline.mapper import Mapper
from pipeline.navigation.navigator import Navigator
from pipeline.transforms import inverse, yaw_of

LOOKS = 8
"""Number of frames that a robot takes around itself when its pose is in doubt."""
SURE_AGREEMENT, FAIR_FIT = 0.98, 0.7
"""Agreement and overlap of a frame; if both are lower, the pose is in doubt. In all 56 steps of two episodes at least
one was higher. If agreement and overlap are both higher than the second, the map is wrong and not the pose, as behind
a curtain."""
UNRIVALLED = 0.9
"""Overlap of a frame above which its pose is trusted if no other place fits for sure either."""


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
        frame, is_there = self._confirm(frame, last)
        return frame if is_there else self._find_place(frame)

    def was_carried(self, frame: Frame) -> bool:
        """Whether a frame contradicts the map so much that the robot must be elsewhere."""
        return self._was_carried(self._agreement(frame))

    def expects(self, frame: Frame) -> bool:
        """Whether the map has surfaces within the camera's reach where a frame was taken."""
        return self._agreement(frame).expected >= TELLING_TILES

    def was_set_down(self, frame: Frame) -> bool:
        """Whether the robot is elsewhere than its drive ended, or has just begun; if so, assume flat ground there."""
        last, self.T_odom_expected = self.T_odom_expected, frame.T_odom_base
        is_elsewhere = last is None or bool(np.linalg.norm(frame.T_odom_base[:3, 3] - last[:3, 3]) > KEYFRAME_WAY)
        if is_elsewhere:
            self._mapper.assume_ground(self._mapper.localise(frame))
        return is_elsewhere

    @property
    def _is_lost(self) -> bool:
        """Whether the robot has yet to be localised in the map of an earlier episode."""
        return self._mapper.localisation.may_err and 0 < len(self._mapper.keyframes) == self._mapper.keyframes.loaded

    def _confirm(self, frame: Frame, last: Frame | None) -> tuple[Frame, bool]:
        """Look around until it is clear whether the robot's pose is right: the newest frame, and whether it is."""
        localisation = self._mapper.localisation
        if not localisation.may_err or self._is_lost:
            return frame, not self._is_lost
        if last is not None and shows_another_place(frame, last):
            return frame, False
        found = self._agreement(frame)
        for _ in range(LOOKS):
            is_elsewhere = self._was_carried(found) or localisation.is_contradicted
            is_unsure = localisation.is_blind or (found.share < SURE_AGREEMENT and localisation.overlap < FAIR_FIT)
            is_doubtful = found.is_doubtful or is_unsure
            if is_elsewhere or not is_doubtful or not self._navigator.turn(2 * np.pi / LOOKS):
                break
            frame = self._sense()
            found = Agreement.of([found, self._agreement(frame)])
        is_elsewhere = self._was_carried(found) or localisation.is_contradicted
        return frame, not (is_elsewhere or found.is_doubtful or localisation.is_blind)

    def _was_carried(self, found: Agreement) -> bool:
        overlap = self._mapper.localisation.overlap
        return found.was_carried and not (found.share > FAIR_FIT and overlap > FAIR_FIT)

    def _agreement(self, frame: Frame) -> Agreement:
        T_map_camera = self._mapper.localise(frame) @ frame.T_base_camera
        return agreement(frame, T_map_camera, self._mapper.metric_map)

    def _find_place(self, frame: Frame) -> Frame:
        """Look around until the robot is localised; returns the newest frame."""
        mapper, relocalisation = self._mapper, Relocalisation(self._navigator.robot.model)
        agreements, agrees = [], []
        for _ in range(LOOKS):
            agreements.append(self._agreement(frame))
            agrees.append(mapper.localisation.agrees)
            relocalisation.add(frame)
            T = relocalisation.find(mapper.metric_map, mapper.elevation_map, mapper.localisation.points())
            if T is not None:
                return self._go_on(frame, T)
            if not self._navigator.turn(2 * np.pi / LOOKS):
                break
            frame = self._sense()
        localisation = mapper.localisation
        fits = localisation.overlap > UNRIVALLED and not localisation.is_contradicted
        around = Agreement.of(agreements)
        # In dust the map has few voxels to compare with, but registration tells as much as to relocalise.
        is_registered = agrees.count(True) >= LEAST_FRAMES and False not in agrees
        has_seen_all = len(agreements) == LOOKS and not around.was_carried
        if not self._is_lost and (fits or (has_seen_all and (is_registered or not around.is_doubtful))):
            # The frames fit the map except for something new, or something that the robot has driven through.
            return self._go_on(frame, mapper.localise(frame))
        raise LostError("the camera shows what the map does not, and no place fits for sure")

    def _go_on(self, frame: Frame, T_map_base: NDArray[np.float64]) -> Frame:
        """Trust a 4×4 pose; if the robot's pose was another one, the robot was carried or set down there."""
        move = inverse(self._mapper.localise(frame)) @ T_map_base
        self.T_odom_expected = frame.T_odom_base
        self._mapper.localisation.trust()
        if self._is_lost or np.linalg.norm(move[:3, 3]) > KEYFRAME_WAY or abs(yaw_of(move)) > KEYFRAME_TURN:
            self._mapper.localisation.set_down(T_map_base)
            self.relocalised += 1
            self.T_odom_expected = None
        return frame
