"""Train an explorer of 2D maps with Stable-Baselines3's PPO (Schulman et al., 2017)."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import ConvertCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import Tensor, nn

from sarsim.tasks.explore_2d import Explore2D
from sarsim.tasks.settings import VIEWPOINTS, ExplorerTrainingConfig, RewardWeights
from sarsim.tasks.viewpoint_network import WIDTH, ViewpointNetwork


class OfViewpoints(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Reduces observations to their viewpoints."""

    def __init__(self, env: Explore2D):
        """Wrap a task."""
        super().__init__(env)
        assert isinstance(env.observation_space, spaces.Dict)
        self.observation_space = env.observation_space["viewpoints"]

    def observation(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """(VIEWPOINTS, 4) the rows of an observation's viewpoints."""
        rows: NDArray[np.float32] = observation["viewpoints"]
        return rows


class ActorAndCritic(nn.Module):
    """A network that chooses viewpoints, and another whose features serve to estimate the value."""

    latent_dim_pi, latent_dim_vf = VIEWPOINTS, 2 * WIDTH

    def __init__(self) -> None:
        """Initialise both with random weights."""
        super().__init__()
        self.actor, self.critic = ViewpointNetwork(), ViewpointNetwork()

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """(B, VIEWPOINTS) logits and (B, 2 · WIDTH) features for flattened rows."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor) -> Tensor:
        """(B, VIEWPOINTS) logits."""
        logits: Tensor = self.actor(features.reshape(-1, VIEWPOINTS, 4))[0]
        return logits

    def forward_critic(self, features: Tensor) -> Tensor:
        """(B, 2 · WIDTH) features."""
        of_all: Tensor = self.critic(features.reshape(-1, VIEWPOINTS, 4))[1]
        return of_all


class ViewpointPolicy(ActorCriticPolicy):
    """A policy whose logits come from a :class:`ViewpointNetwork`."""

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = ActorAndCritic()  # type: ignore[assignment]  # has what the policy uses of the other

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.action_net = nn.Identity()  # the network's logits are the policy's


def train_explorer(config: ExplorerTrainingConfig, on_step: Callable[[], object]) -> ViewpointNetwork:
    """Train on drawn maps of the split ``train`` with the rules ``papers``, to minimise driving time.

    ``on_step`` is called after each of the ``config.steps / config.worlds`` steps of all worlds.
    """

    def count(*_: object) -> bool:
        on_step()
        return True

    torch.set_num_threads(1)  # the network is small
    for_the_way = RewardWeights(ground=0.0)
    worlds = DummyVecEnv([lambda: OfViewpoints(Explore2D(rules="papers", weights=for_the_way))] * config.worlds)
    # Without orthogonal weights, and with normalised rewards; otherwise the value loss outweighs the policy loss.
    agent = PPO(
        ViewpointPolicy,
        VecNormalize(worlds, norm_obs=False),
        n_steps=config.horizon,
        batch_size=config.horizon,
        learning_rate=lambda left: config.rate * left,
        n_epochs=config.epochs,
        ent_coef=config.entropy,
        policy_kwargs={"ortho_init": False},
        seed=config.seed,
        device="cpu",
    )
    agent.learn(config.steps, callback=ConvertCallback(count))
    extractor = agent.policy.mlp_extractor
    assert isinstance(extractor, ActorAndCritic)
    return extractor.actor
