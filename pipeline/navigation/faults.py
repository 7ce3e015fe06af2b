"""Faults that the robot notices in its sensors, its wheels and its localisation."""

from dataclasses import dataclass

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief, MotionState
from pipeline.localisation.vertical import T_floor_camera
from pipeline.navigation.config import FaultConfig

MOTION_FAULTS = {
    MotionState.SLIPPING: "the wheels are slipping",
    MotionState.HELD: "the wheels spin, but the robot does not move",
    MotionState.BLIND: "the camera view is not enough to locate the robot",
}


@dataclass(frozen=True)
class Fault:
    """A fault that the robot has noticed.

    Attributes:
        kind: ``camera`` (no frame), ``depth_scale``, ``slipping``, ``held`` (the wheels spin), ``blind``, ``stuck``,
            ``registration`` (invalid and left out of the pose graph), ``carried`` or ``lost``.
        time_s: time at which the fault was noticed, s.
        text: description of the fault.
    """

    kind: str
    time_s: float
    text: str


class Faults:
    """The faults noticed so far.

    Attributes:
        all: all faults in the order in which they were noticed.
    """

    def __init__(self, config: FaultConfig = FaultConfig()) -> None:
        """Start without faults."""
        self.all: list[Fault] = []
        self._config = config

    def note(self, kind: str, time: float, text: str) -> None:
        """Add a fault noticed at a time, s, unless the newest fault has the same kind and text."""
        if not self.all or (self.all[-1].kind, self.all[-1].text) != (kind, text):
            self.all.append(Fault(kind, time, text))

    def check_motion(self, belief: Belief, time: float) -> None:
        """Note a fault at a time, s, if the most likely motion state is a fault."""
        if belief.state in MOTION_FAULTS:
            self.note(belief.state.name.lower(), time, MOTION_FAULTS[belief.state])

    def check_depth_scale(self, frame: Frame) -> None:
        """Note a fault if the floor seen at the start is not at the expected distance below the camera."""
        height = float(frame.T_base_camera[2, 3])
        try:
            seen = float(T_floor_camera(frame)[2, 3])
        except InputError:  # No floor is in view
            return
        if abs(seen - height) > self._config.max_depth_scale_error * height:
            text = f"the camera measures its height as {seen:.2f} m, but it is mounted {height:.2f} m above the floor"
            self.note("depth_scale", frame.time, text)
