"""Settings of the tasks."""

from dataclasses import dataclass

from tyro.conf import Fixed

VIEWPOINTS = 32
"""Maximum number of viewpoints from which an agent chooses."""


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


@dataclass(frozen=True)
class ExplorerTrainingConfig:
    """How to train an explorer of 2D maps with PPO; all other settings are Stable-Baselines3's defaults.

    Attributes:
        steps: number of training steps, summed over all worlds.
        seed: seed of all random numbers.
        worlds: number of worlds explored at the same time.
        horizon: number of steps in each world between two updates; also the batch size.
        epochs: number of passes over these steps.
        rate: learning rate at the start; it falls linearly to 0.
        entropy: weight of the entropy of the choice in the loss.
    """

    steps: int = 500_000
    seed: int = 0
    worlds: Fixed[int] = 8
    horizon: Fixed[int] = 256
    epochs: Fixed[int] = 4
    rate: Fixed[float] = 1e-3
    entropy: Fixed[float] = 0.003
