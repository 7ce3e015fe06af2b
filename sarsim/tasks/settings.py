"""Settings of the tasks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RewardWeights:
    """What an agent is rewarded for; a reward is the sum of these times what a step brought.

    Attributes:
        ground: per m² of ground seen for the first time.
        time: per second.
    """

    ground: float = 1.0
    time: float = -0.1
