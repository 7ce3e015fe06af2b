"""When a frame on the way becomes a keyframe."""

from dataclasses import dataclass
from math import radians

import numpy as np

from pipeline.arrays import Pose
from pipeline.transforms import angle_of, inverse


@dataclass(frozen=True)
class KeyframePolicy:
    """How keyframes are spaced.

    Attributes:
        way: m that the robot drives from one keyframe to the next.
        turn: rad that it turns from one keyframe to the next.
        labelled_every: of so many keyframes taken on the way one is labelled: the network is the slowest stage.
    """

    way: float = 0.3
    turn: float = radians(15)
    labelled_every: int = 6

    def is_due(self, T_odom_keyframe: Pose, T_odom_base: Pose) -> bool:
        """Whether a pose is far enough from that of the last keyframe to take another one."""
        moved = inverse(T_odom_keyframe) @ T_odom_base
        return bool(np.linalg.norm(moved[:3, 3]) >= self.way or angle_of(moved) >= self.turn)

    def is_labelled(self, keyframes: int) -> bool:
        """Whether the next keyframe on the way is labelled, after so many keyframes."""
        return keyframes % self.labelled_every == 0
