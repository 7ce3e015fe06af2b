"""When the robot takes keyframes, and what the navigator learns from them while it drives."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.belief import MotionState
from pipeline.localisation.localisation import LostError, is_keyframe
from pipeline.mapper import Keyframe, Mapper
from pipeline.metric_map.isolated_returns import without_isolated_returns
from pipeline.navigation.faults import Faults
from pipeline.navigation.navigator import MotionCheck, Navigator
from pipeline.navigation.pose_check import PoseCheck
from pipeline.transforms import angle_of, inverse

LABELLED = 6
"""During a drive one keyframe in this many is labelled: the network is the slowest stage."""


class Keyframing:
    """Makes keyframes for the mapper, and tells the navigator where the robot is.

    Attributes:
        pose_check: whether the robot is where it thinks.
        faults: of the camera.
    """

    def __init__(
        self, navigator: Navigator, mapper: Mapper, on_keyframe: Callable[[Keyframe], object] = lambda keyframe: None
    ) -> None:
        """``on_keyframe`` is called with every keyframe, also those taken during a drive."""
        self.pose_check = PoseCheck(navigator, mapper, self._sense)
        self._navigator, self._mapper, self._on_keyframe = navigator, mapper, on_keyframe
        self._T_odom_keyframe = np.eye(4)
        self._last: Frame | None = None
        self.faults = Faults()
        self._has_seen = False
        self._T_odom_unseen: list[NDArray[np.float64]] = []  # of the newest frames, which show nothing

    def sense(self) -> Frame:
        """The newest frame, once the robot has looked around as much as it needs to know its pose.

        Raises:
            LostError: the pose remains in doubt, or the camera shows nothing any more.
        """
        last = self._last
        with self._mapper.stopwatch("sense"):
            frame = self._sense()
        if last is None:
            self.faults.check_depth_scale(frame)
        return self.pose_check.confirmed(frame, last)

    def add(self, frame: Frame, labelled: bool) -> Keyframe:
        """Make a keyframe of a frame."""
        keyframe = self._mapper.add(frame, self._mapper.localise(frame), labelled)
        self._go_on(frame)
        self._on_keyframe(keyframe)
        return keyframe

    def look(self) -> MotionCheck:
        """Localise anew if the robot has moved far enough: whether it moves, and its pose is sure.

        The frame becomes a keyframe unless it repeats one.
        """
        assert self._navigator.motion is not None
        if not is_keyframe(self._T_odom_keyframe, self._navigator.motion.T_odom_base):
            return MotionCheck.FINE
        frame, localisation = self._sense(), self._mapper.localisation
        self.pose_check.compare(frame, is_driving=True)
        self.faults.check_motion(localisation.belief, frame.time)
        if not localisation.belief.knows_place:
            return MotionCheck.UNSURE
        T_map_base = self._mapper.localise(frame)
        if localisation.repeats:
            localisation.pass_by(frame, T_map_base)
            self._go_on(frame)
        else:
            self.add(frame, labelled=len(self._mapper.keyframes) % LABELLED == 0)
        return MotionCheck.SPINNING if localisation.belief.is_sure_of(MotionState.HELD) else MotionCheck.FINE

    def returns(self) -> NDArray[np.float32]:
        """(N, 3) the camera's present returns, m in ``map``; their frame becomes a keyframe."""
        frame = self._sense()
        return frame.points(self.add(frame, labelled=False).T_map_base @ frame.T_base_camera)

    def _go_on(self, frame: Frame) -> None:
        """Measure the way to the next keyframe from a frame, and drive by its pose."""
        self._T_odom_keyframe = frame.T_odom_base
        self._navigator.correct(self._mapper.localisation.T_map_odom)

    def _sense(self) -> Frame:
        self._last = without_isolated_returns(self._frame())
        self._check_depth(self._last)
        return self._last

    def _check_depth(self, frame: Frame) -> None:
        """LostError if nothing was seen in a turn around, or on a way on which what is too near comes into view.

        A frame counts if the map has something there to be seen, or if nothing at all was seen yet.
        """
        if frame.returns.any():
            self._has_seen = True
            self._T_odom_unseen.clear()
        elif not self._has_seen or self.pose_check.expects(frame):
            self._T_odom_unseen.append(frame.T_odom_base)
        moves = [inverse(a) @ b for a, b in pairwise(self._T_odom_unseen)]
        way = sum(np.linalg.norm(T[:3, 3]) for T in moves)
        if way > frame.sensor.nearest or sum(map(angle_of, moves)) > 2 * np.pi:
            raise LostError(
                f"the camera measures no depth: at {frame.time:.2f} s in {len(moves) + 1} frames in a row"
            )

    def _frame(self) -> Frame:
        """The camera's newest frame; LostError if it fails twice in a row."""
        try:
            return self._navigator.robot.sense()
        except InputError:
            raise
        except Exception as error:  # of whatever driver
            time = self._navigator.motion.time if self._navigator.motion else 0.0
            self.faults.note("camera", time, f"the camera gave no frame: {error or type(error).__name__}")
        try:
            return self._navigator.robot.sense()
        except Exception as error:
            raise LostError(f"the camera gives no frame: {error or type(error).__name__}") from error
