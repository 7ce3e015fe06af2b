"""Whether the robot makes progress, by the commands that it was given and the poses that followed."""

import numpy as np
from numpy.typing import NDArray

from pipeline.localisation.localisation import STILL_TURN, STILL_WAY
from pipeline.robot import RobotModel, Velocity
from pipeline.transforms import wrap_angle, yaw_of

BLOCKED_TIME = 0.5
"""s over which speeds are averaged to notice that something holds the robot."""
BLOCKED_SHARE = 0.35
"""Share of the commanded speed; a slower robot is held, unless it is on a ramp."""
STUCK_TIME = 4.0
"""s without progress after which the robot is stuck."""
OVERDUE = 60.0
"""s that a turn may take, and that a leg may take beyond four times what it takes on a ramp: a robot that
slides back and forth moves, and still makes no progress."""
LEAST_JUDGED = np.array([0.04, 0.15])
"""m/s and rad/s; slower commands are not judged."""
REACTION = 0.3
"""s in which a robot may still follow its last command: commands cross a network, and both ends are busy. A longer
time between two poses is not judged: a real robot had no new command while its software computed."""


class Turn(Velocity):
    """A command to turn in place; ``v`` only makes up for sliding down a ramp."""


class Progress:
    """Notices when the robot is held, and when neither its position nor its heading changes any more."""

    def __init__(self, robot: RobotModel, T: NDArray[np.float64], time: float, length: float = 0.0):
        """Begin at a pose (4×4) and a time in s; ``length`` of the leg in m."""
        self._limits = np.array([robot.acceleration, robot.turn_acceleration])
        self._deadline = time + OVERDUE + 4 * length / robot.ramp_speed
        self._anchor, self._since = T, time
        self._last, self._time = T, time
        self._restart(time)

    def _restart(self, time: float) -> None:
        # (2,) forward speed and turn rate: due by commands and acceleration, and averages of the due and actual ones.
        self._due: NDArray[np.float64] | None = None
        self._wanted, self._felt, self._judged_from = np.zeros(2), np.zeros(2), time + REACTION

    def is_stuck(self, T: NDArray[np.float64], time: float, command: Velocity, on_ramp: bool = False) -> bool:
        """Whether the newest 4×4 pose shows that the robot cannot follow the command; on ramps wheels may skid."""
        if (pause := time - self._time) > REACTION:
            self._since, self._deadline, self._time = self._since + pause, self._deadline + pause, time
            self._restart(time)
        held = self._is_held(T, time, command) and not on_ramp
        # In a turn, wheels that spin on one side alone seem to move the robot.
        moved = np.linalg.norm(T[:3, 3] - self._anchor[:3, 3]) > STILL_WAY and not isinstance(command, Turn)
        turned = abs(wrap_angle(yaw_of(T) - yaw_of(self._anchor))) > STILL_TURN
        if moved or turned:
            self._anchor, self._since = T, time
        self._last, self._time = T, time
        return held or time - self._since > STUCK_TIME or time > self._deadline

    def _is_held(self, T: NDArray[np.float64], time: float, command: Velocity) -> bool:
        dt = time - self._time
        if dt <= 0 or time < self._judged_from:
            return False
        limit = self._limits * dt
        # The speed by which a turn makes up for sliding need not move the robot.
        asked = np.array([0.0 if isinstance(command, Turn) else command.v, command.omega])
        forward = float((T[:3, 3] - self._last[:3, 3]) @ self._last[:3, 0])
        speeds = np.array([forward, wrap_angle(yaw_of(T) - yaw_of(self._last))]) / dt
        due = speeds if self._due is None else self._due
        self._due = due + np.clip(asked - due, -limit, limit)
        share = min(1.0, dt / BLOCKED_TIME)
        # A robot that brakes harder than it should is not held.
        wanted = np.minimum(np.abs(self._due), np.abs(asked)) * (self._due * asked > 0)
        self._wanted += share * (wanted - self._wanted)
        self._felt += share * (speeds * np.sign(self._due) - self._felt)
        counts = self._wanted > LEAST_JUDGED
        counts[1] &= asked[0] == 0
        return bool((counts & (self._felt < BLOCKED_SHARE * self._wanted)).any())
