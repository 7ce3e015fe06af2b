"""Whether the robot makes progress, judged by its commands and the resulting poses."""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.navigation.commands import Turn
from pipeline.navigation.config import ProgressConfig
from pipeline.robot import RobotModel, Velocity
from pipeline.transforms import wrap_angle, yaw_of


class Progress:
    """Detects when the robot is held, and when its position and heading no longer change."""

    def __init__(self, robot: RobotModel, T: Pose, time: float, config: ProgressConfig, length: float = 0.0):
        """Start at a pose and a time, s; ``length``: length of the leg, m."""
        self._limits, self._config = np.array([robot.acceleration, robot.turn_acceleration]), config
        self._deadline = time + config.overdue + config.overdue_ramp * length / robot.ramp_speed
        self._anchor, self._since = T, time
        self._last, self._time = T, time
        self._restart(time)

    def _restart(self, time: float) -> None:
        # (2,) forward speed and turn rate: expected by command and acceleration; averages of expected and actual.
        self._due: NDArray[np.float64] | None = None
        self._wanted, self._felt, self._judged_from = np.zeros(2), np.zeros(2), time + self._config.reaction

    def is_stuck(self, T: Pose, time: float, command: Velocity, on_ramp: bool = False) -> bool:
        """Whether the newest pose shows that the robot cannot follow the command; on ramps, the wheels may skid."""
        config = self._config
        if (pause := time - self._time) > config.reaction:
            self._since, self._deadline, self._time = self._since + pause, self._deadline + pause, time
            self._restart(time)
        held = self._is_held(T, time, command) and not on_ramp
        # In a turn, wheels that spin on only one side seem to move the robot.
        moved = np.linalg.norm(T[:3, 3] - self._anchor[:3, 3]) > config.still_way and not isinstance(command, Turn)
        turned = abs(wrap_angle(yaw_of(T) - yaw_of(self._anchor))) > config.still_turn
        if moved or turned:
            self._anchor, self._since = T, time
        self._last, self._time = T, time
        return held or time - self._since > config.patience or time > self._deadline

    def _is_held(self, T: Pose, time: float, command: Velocity) -> bool:
        dt, config = time - self._time, self._config
        if dt <= 0 or time < self._judged_from:
            return False
        limit = self._limits * dt
        # The speed that compensates for sliding during a turn need not move the robot.
        asked = np.array([0.0 if isinstance(command, Turn) else command.v, command.omega])
        forward = float((T[:3, 3] - self._last[:3, 3]) @ self._last[:3, 0])
        speeds = np.array([forward, wrap_angle(yaw_of(T) - yaw_of(self._last))]) / dt
        due = speeds if self._due is None else self._due
        self._due = due + np.clip(asked - due, -limit, limit)
        share = min(1.0, dt / config.averaged)
        # A robot that brakes harder than it should is not held.
        wanted = np.minimum(np.abs(self._due), np.abs(asked)) * (self._due * asked > 0)
        self._wanted += share * (wanted - self._wanted)
        self._felt += share * (speeds * np.sign(self._due) - self._felt)
        counts = self._wanted > (config.least_v, config.least_omega)
        counts[1] &= asked[0] == 0
        return bool((counts & (self._felt < config.held_share * self._wanted)).any())
