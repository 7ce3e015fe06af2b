"""Train an explorer of 2D maps by PPO (Schulman et al., 2017), the one of Stable-Baselines3."""

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
    """Shows an agent the viewpoints of an observation alone."""

    def __init__(self, env: Explore2D):
        """Wrap a task."""
        super().__init__(env)
        assert isinstance(env.observation_space, spaces.Dict)
        self.observation_space = env.observation_space["viewpoints"]

    def observation(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """(VIEWPOINTS, 4) the rows."""
        rows: NDArray[np.float32] = observation["viewpoints"]
        return rows


class ActorAndCritic(nn.Module):
    """The network that chooses, and another whose features show what is still to come."""

    latent_dim_pi, latent_dim_vf = VIEWPOINTS, 2 * WIDTH

    def __init__(self) -> None:
        """Begin with random weights."""
        super().__init__()
        self.actor, self.critic = ViewpointNetwork(), ViewpointNetwork()

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """(B, VIEWPOINTS) logits, and (B, 2 · WIDTH) features, of flattened rows."""
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
    """The policy whose logits are those of a :class:`ViewpointNetwork`."""

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = ActorAndCritic()  # type: ignore[assignment]  # has what the policy uses of the other

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.action_net = nn.Identity()  # the network's logits are the policy's


def train_explorer(config: ExplorerTrainingConfig, on_step: Callable[[], object]) -> ViewpointNetwork:
    """Train on the drawn maps of the split ``train`` by the papers' protocol, for the shortest way.

    ``on_step`` is called after each of the ``config.steps / config.worlds`` steps of all worlds.
    """

    def count(*_: object) -> bool:
        on_step()
        return True

    torch.set_num_threads(1)  # the network is small
    for_the_way = RewardWeights(ground=0.0)
    worlds = DummyVecEnv([lambda: OfViewpoints(Explore2D(rules="papers", weights=for_the_way))] * config.worlds)
    # Without orthogonal weights, and with rewards of a variance of one: else the values' loss outweighs the policy's.
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
