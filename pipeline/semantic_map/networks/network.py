"""What every network on points offers to the trainer, to files and to the robot."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Protocol, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.errors import InputError

MOST_CHANNELS, MOST_CLASSES = 64, 1000
"""Of weights from files; published ones have 9 channels and 13 classes."""


class PointNetwork(nn.Module, ABC):
    """A network that tells what each point of a block is.

    Attributes:
        NAME: in files and commands.
        STORED: type of the numbers in files; half precision changes no class, and all networks together stay small.
        channels: of a point: x, y, z in m from the middle of the block, and more.
        classes: that it tells apart.
        penalty: what its paper adds to the loss, of the last forward pass.
    """

    NAME: ClassVar[str]
    STORED: ClassVar[torch.dtype] = torch.float16
    penalty: Tensor | float = 0.0

    def __init__(self, channels: int, classes: int) -> None:
        """No layers yet."""
        super().__init__()
        self.channels, self.classes = channels, classes

    @property
    def fewest(self) -> int:
        """Least number of points of a block."""
        return 1

    @classmethod
    def for_weights(cls, tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> Self:
        """A network of the size that a file's ``tensors`` have or ``metadata`` tell; ValueError if there is none."""
        sizes = [metadata.get(name, "") for name in ("channels", "classes")]
        channels, classes = (int(size) if size.isdecimal() and len(size) < 5 else 0 for size in sizes)
        if not (3 < channels <= MOST_CHANNELS and 1 <= classes <= MOST_CLASSES):
            raise ValueError(f"{sizes[0]!r:.20} channels and {sizes[1]!r:.20} classes are none of a {cls.NAME}")
        return cls(channels, classes)

    def about(self) -> dict[str, str]:
        """What a file must say beside the weights for :meth:`for_weights`."""
        return {"channels": str(self.channels), "classes": str(self.classes)}

    def published(self) -> dict[str, Tensor]:
        """All parameters and running statistics by their names in files."""
        state = self.state_dict()
        return {name: tensor for name, tensor in state.items() if not name.endswith("num_batches_tracked")}

    def file_names(self, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
        """A file's ``tensors`` without what stands there twice."""
        return tensors


class RowNetwork(PointNetwork):
    """A network that takes its blocks one after the other, as rows of one array: none is padded."""

    @abstractmethod
    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, channels) float32 points of blocks of ``sizes``, which add up to P, to (P, classes) logits."""


class BlockClassifier(Protocol):
    """A network ready to classify.

    Attributes:
        classes: that it tells apart.
        fewest: least number of points of a block.
    """

    classes: int
    fewest: int

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, channels) float32 points of a block to (N, classes) float32 logits.

        Raises:
            InputError: as of :func:`check_block`.
        """


def check_block(network: PointNetwork, points: NDArray[np.float32]) -> None:
    """Raises InputError if (N, C) points are too few, of another number of channels, or not finite."""
    if points.ndim != 2 or points.shape[1] != network.channels or len(points) < network.fewest:
        wanted = f"(at least {network.fewest}, {network.channels})"
        raise InputError(f"{network.NAME}: a block of points {points.shape} is not {wanted}")
    if not np.isfinite(points).all():
        raise InputError(f"{network.NAME}: a block holds points that are not finite")
