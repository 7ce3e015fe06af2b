"""When a frame becomes a keyframe during a drive."""

from dataclasses import dataclass
from math import radians

import numpy as np

from pipeline.arrays import Pose
from pipeline.errors import require_at_least, require_positive
from pipeline.transforms import angle_of, inverse


@dataclass(frozen=True)
class KeyframePolicy:
    """How keyframes are spaced.

    A frame closer to a keyframe than this repeats it, if it shows no more.

    Attributes:
        way: distance from the last keyframe at which a new one is due, m.
        turn: rotation from the last keyframe at which a new one is due, rad.
        labelled_every: a keyframe of a drive is labelled only if the number of keyframes before it is a multiple of
            this, because the network is the slowest stage.
    """

    way: float = 0.3
    turn: float = radians(15)
    labelled_every: int = 6

    def __post_init__(self) -> None:
        """InputError if keyframes cannot be spaced like this."""
        require_positive("localisation.keyframes", self, "way", "turn")
        require_at_least(1, "localisation.keyframes", self, "labelled_every")

    def is_due(self, T_odom_keyframe: Pose, T_odom_base: Pose) -> bool:
        """Whether a pose is far enough from that of the last keyframe to take a new one."""
        moved = inverse(T_odom_keyframe) @ T_odom_base
        return bool(np.linalg.norm(moved[:3, 3]) >= self.way or angle_of(moved) >= self.turn)

    def is_labelled(self, keyframes: int) -> bool:
        """Whether the next keyframe of a drive is labelled, given the number of ``keyframes`` before it."""
        return keyframes % self.labelled_every == 0
