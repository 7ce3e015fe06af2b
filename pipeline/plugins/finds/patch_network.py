"""Convolutional classifiers of small square image patches, for hazmat signs and for objects on walls."""

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.plugins.finds.squares import PATCH_SIDE

WIDTHS = 24, 48, 64, 96, 96  # Channels after each convolution


class PatchNetwork(nn.Sequential):
    """Convolutions that halve a patch four times, and a linear layer that scores the classes, with "none" last."""

    def __init__(self, classes: int, has_relief: bool = False, side: int = PATCH_SIDE) -> None:
        """Start with random weights, for patches of ``side`` pixels with colours, or with colours and relief."""
        layers, before = list[nn.Module](), 3 + has_relief
        for width in WIDTHS:
            stride = 2 if width != before else 1
            layers += [nn.Conv2d(before, width, 3, stride, 1, bias=False), nn.BatchNorm2d(width), nn.ReLU()]
            before = width
        layers += [nn.Flatten(), nn.Dropout(0.3)]
        super().__init__(*layers, nn.Linear((side // 2 ** len(set(WIDTHS))) ** 2 * before, classes + 1))

    @classmethod
    def load(cls, path: Path, classes: int, has_relief: bool = False, side: int = PATCH_SIDE) -> "PatchNetwork":
        """The network of a safetensors file, in evaluation mode.

        Raises:
            InputError: the file is missing or damaged, or belongs to another network.
        """
        network = cls(classes, has_relief, side)
        try:
            network.load_state_dict({name: value.float() for name, value in load_file(path).items()})
        except (OSError, SafetensorError, RuntimeError) as error:
            reason = str(error).splitlines()[0]
            what = f"not the weights of a classifier with {classes} classes"
            raise InputError(f"{path}: {what} ({reason}); use another file") from error
        return network.eval()

    def probabilities(self, patches: NDArray[np.uint8], turns: int = 4) -> NDArray[np.float32]:
        """(N, classes + 1) probabilities of (N, side, side, C) patches, averaged over ``turns`` rotations by 90°."""
        with torch.inference_mode():
            images = _to_input(patches)
            turned = [self(torch.rot90(images, k, (2, 3))).softmax(1) for k in range(turns)]
            return np.asarray(torch.stack(turned).mean(0).numpy())


def _to_input(patches: NDArray[np.uint8]) -> Tensor:
    """(N, channels, H, W) float32 from (N, H, W, channels) uint8 patches.

    Each patch's colours are standardised to zero mean and about unit variance; its relief is scaled to [0, 1].
    """
    images = torch.from_numpy(np.ascontiguousarray(patches)).permute(0, 3, 1, 2).float()
    colours, relief = images[:, :3], images[:, 3:]
    mean = colours.mean((1, 2, 3), keepdim=True)
    # This is several times as fast as PyTorch's std, and the squared differences are small enough for float32.
    deviation = ((colours - mean).square_().mean((1, 2, 3), keepdim=True)).sqrt_()
    evened = (colours - mean) / (deviation + 1)
    return torch.cat([evened, relief / np.iinfo(np.uint8).max], 1)
