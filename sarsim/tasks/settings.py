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


@dataclass(frozen=True)
class ExploreWeights(RewardWeights):
    """What an agent that explores in MuJoCo is rewarded for besides.

    Attributes:
        finds: per person or thing to find.
        contact: per contact with a wall, clutter or a victim.
        tipping: for tipping over.
    """

    finds: float = 10.0
    contact: float = -1.0
    tipping: float = -10.0


@dataclass(frozen=True)
class DriveWeights:
    """What a driving agent is rewarded for; a reward is the sum of these times what a step brought.

    Attributes:
        progress: per m nearer to the goal.
        time: per second.
        contact: per contact with a wall, clutter or a victim.
        tipping: for tipping over.
    """

    progress: float = 1.0
    time: float = -0.1
    contact: float = -1.0
    tipping: float = -10.0
