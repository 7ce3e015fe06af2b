"""A network that chooses among viewpoints from their positions and what they should show."""

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from pipeline.errors import InputError

WIDTH = 64
"""Number of features of a viewpoint, as in the layers of Stable-Baselines3's default MLPs."""


class ViewpointNetwork(nn.Module):
    """Scores each viewpoint together with mean and maximum features of all, so that their order has no influence."""

    def __init__(self) -> None:
        """Initialise with random weights."""
        super().__init__()
        self.each = nn.Sequential(nn.Linear(4, WIDTH), nn.Tanh(), nn.Linear(WIDTH, WIDTH), nn.Tanh())
        self.beside = nn.Sequential(nn.Linear(3 * WIDTH, WIDTH), nn.Tanh(), nn.Linear(WIDTH, 1))

    @classmethod
    def load(cls, path: Path) -> "ViewpointNetwork":
        """Load a network from a safetensors file.

        Raises:
            InputError: the file is missing or damaged, or holds the weights of another network.
        """
        network, remedy = cls(), "train an explorer with 'sarsim-train explorer'"
        try:
            network.load_state_dict(load_file(path))
        except RuntimeError as error:
            raise InputError(f"{path}: the tensors are not the weights of an explorer; {remedy}") from error
        except (OSError, SafetensorError) as error:
            said = f"cannot be read ({' '.join(str(error).split())})" if path.exists() else "no such file"
            raise InputError(f"{path}: {said}; {remedy}") from error
        return network

    def forward(self, viewpoints: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N) logits of viewpoints and (B, 2 · WIDTH) features of all, for (B, N, 4) rows as in an observation."""
        is_one = viewpoints[..., 3:] > 0
        of_each = self.each(viewpoints)
        mean = (of_each * is_one).sum(dim=1) / is_one.sum(dim=1).clamp(min=1)
        most = of_each.masked_fill(~is_one, -1).amax(dim=1)  # -1 is the minimum of tanh
        of_all = torch.cat([mean, most], dim=1)
        both = torch.cat([of_each, of_all[:, None].expand(-1, viewpoints.shape[1], -1)], dim=2)
        logits = self.beside(both).masked_fill(~is_one, torch.finfo(torch.float32).min)
        return logits.squeeze(2), of_all

    def choice(self, viewpoints: NDArray[np.float64]) -> int:
        """The row of the viewpoint with the highest score among (N, 4)."""
        with torch.inference_mode():
            logits, _ = self(torch.from_numpy(viewpoints.astype(np.float32))[None])
        return int(logits.argmax())
