"""The classifier of hazmat signs: a small convolutional network for rectified squares."""

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from pipeline.errors import InputError
from pipeline.finds.hazmat_classes import HAZMAT_CLASSES

PATCH, SURROUNDINGS = 64, 0.1
"""Pixels along a patch, and the share of it that surrounds the sign on each side."""
WIDTHS = 24, 48, 64, 96, 96  # Channels after each convolution


class HazmatNetwork(nn.Sequential):
    """Four halvings of a patch, and the scores of each class, "no sign" last."""

    def __init__(self) -> None:
        """Random weights."""
        layers, before = list[nn.Module](), 3
        for width in WIDTHS:
            stride = 2 if width != before else 1
            layers += [nn.Conv2d(before, width, 3, stride, 1, bias=False), nn.BatchNorm2d(width), nn.ReLU()]
            before = width
        layers += [nn.Flatten(), nn.Dropout(0.3)]
        super().__init__(*layers, nn.Linear((PATCH // 2 ** len(set(WIDTHS))) ** 2 * before, len(HAZMAT_CLASSES) + 1))

    @classmethod
    def load(cls, path: Path) -> "HazmatNetwork":
        """The network of a safetensors file, in evaluation mode.

        Raises:
            InputError: the file is missing, damaged or of another network.
        """
        network = cls()
        try:
            network.load_state_dict({name: value.float() for name, value in load_file(path).items()})
        except (OSError, SafetensorError, RuntimeError) as error:
            raise InputError(f"{path}: no weights of the hazmat classifier: {str(error).splitlines()[0]}") from error
        return network.eval()

    def probabilities(self, patches: NDArray[np.uint8], turns: int = 4) -> NDArray[np.float32]:
        """(N, classes + 1) of (N, PATCH, PATCH, 3) patches, the mean over so many turns of a square."""
        with torch.inference_mode():
            images = to_input(patches)
            turned = [self(torch.rot90(images, k, (2, 3))).softmax(1) for k in range(turns)]
            return np.asarray(torch.stack(turned).mean(0).numpy())


def to_input(patches: NDArray[np.uint8]) -> Tensor:
    """(N, 3, H, W) float32 of (N, H, W, 3) uint8 patches, each less its mean and over its standard deviation."""
    images = torch.from_numpy(patches.astype(np.float32).transpose(0, 3, 1, 2))
    middle = images.mean((1, 2, 3), keepdim=True)
    return (images - middle) / (images.std((1, 2, 3), keepdim=True) + 1)
