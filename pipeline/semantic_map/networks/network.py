"""The interface of point networks for training, files and the robot."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from pipeline.errors import InputError

MAX_CHANNELS = 64
"""Maximum number of channels, and of classes, of weights from files; published weights have 9 and 13."""


class PointNetwork(nn.Module, ABC):
    """A network that classifies each point of several blocks, concatenated as rows of one array without padding.

    Attributes:
        NAME: name of the network in files and commands.
        channels: number of channels of a point: x and y relative to the centre of the block, z (all m), and others.
        classes: number of classes.
        penalty: the term that the network's paper adds to the loss, from the last forward pass.
    """

    NAME: ClassVar[str]
    penalty: Tensor | float = 0.0

    def __init__(self, channels: int, classes: int) -> None:
        """Store the sizes; subclasses create the layers."""
        super().__init__()
        self.channels, self.classes = channels, classes

    @abstractmethod
    def forward(self, points: Tensor, sizes: Sequence[int]) -> Tensor:
        """(P, classes) logits of (P, channels) float32 points, in blocks of ``sizes`` points."""

    @property
    def min_points(self) -> int:
        """Minimum number of points of a block."""
        return 1

    @classmethod
    def for_weights(cls, tensors: Mapping[str, Tensor], metadata: Mapping[str, str]) -> Self:
        """A network with the size of a file's ``tensors`` or ``metadata``; ValueError if the size is out of range."""
        for name, least in (("channels", 4), ("classes", 1)):
            if not least <= whole_number(metadata.get(name, "")) <= MAX_CHANNELS:
                found = f"not {metadata[name]!r:.20}" if name in metadata else "but is missing"
                limits = f"from {least} to {MAX_CHANNELS}"
                raise ValueError(f"the number of {name} of {cls.NAME} must be a whole number {limits}, {found}")
        return cls(whole_number(metadata["channels"]), whole_number(metadata["classes"]))

    def metadata(self) -> dict[str, str]:
        """The metadata that :meth:`for_weights` needs in addition to the weights."""
        return {"channels": str(self.channels), "classes": str(self.classes)}

    def file_tensors(self) -> dict[str, Tensor]:
        """All parameters and running statistics by their names in files."""
        state = self.state_dict()
        return {name: tensor for name, tensor in state.items() if not name.endswith("num_batches_tracked")}

    def without_duplicates(self, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
        """A file's ``tensors`` without duplicates."""
        return tensors


def whole_number(text: str) -> int:
    """A whole number from a file's metadata; 0 if the text is not a whole number, or has too many digits."""
    try:
        return int(text) if text.isdecimal() else 0
    except ValueError:
        return 0


class BlockClassifier(Protocol):
    """A network ready for inference.

    Attributes:
        classes: number of classes.
        min_points: minimum number of points of a block.
    """

    classes: int
    min_points: int

    def __call__(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, classes) float32 logits of a block's (N, channels) float32 points.

        Raises:
            InputError: see :func:`check_block`.
        """

    def of_blocks(self, blocks: Iterable[NDArray[np.float32]]) -> Iterator[NDArray[np.float32]]:
        """The logits of several blocks, computed faster than with one call per block."""


def check_block(network: PointNetwork, points: NDArray[np.float32]) -> None:
    """Raise InputError if (N, C) points are too few, have a wrong number of channels, or are not finite."""
    if points.ndim != 2 or points.shape[1] != network.channels or len(points) < network.min_points:
        wanted = f"(N, {network.channels}) with N at least {network.min_points}"
        raise InputError(f"{network.NAME}: a block must have shape {wanted}, not {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"{network.NAME}: a block must not contain NaN or infinite values")
