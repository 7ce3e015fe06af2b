"""Networks for tests."""

from pathlib import Path

import numpy as np

SMALL = """
[net]
width=16
height=8
channels=3

[convolutional]
batch_normalize=1
filters=2
size=3
stride=2
pad=1
activation=leaky

[convolutional]
filters=6
size=1
activation=linear

[yolo]
mask=0
anchors=4,6
classes=1
num=1
"""
"""One convolution and one anchor in 8 × 4 cells."""
HEADER = np.array([0, 2, 5, 0, 0], "<i4").tobytes()
"""Of Darknet's weights, of a network that has seen no images."""


def darknet_files(folder: Path, text: str = SMALL, numbers: np.ndarray | None = None) -> tuple[Path, Path]:
    """The files of a network, with random weights unless some are given."""
    files = folder / "n.cfg", folder / "n.weights"
    files[0].write_text(text)
    numbers = small_numbers() if numbers is None else numbers
    files[1].write_bytes(HEADER + numbers.astype("<f4").tobytes())
    return files


def small_numbers(seed: int = 0) -> np.ndarray:
    """Random weights of SMALL."""
    return np.random.default_rng(seed).uniform(0.1, 0.9, 4 * 2 + 2 * 27 + 6 + 12)


def bright_spots(classes: int = 1) -> np.ndarray:
    """Weights with which SMALL sees a person of 4 × 6 pixels wherever its input is white."""
    last = np.zeros((5 + classes, 2))
    last[4:, 0] = 20
    bias = np.where(np.arange(5 + classes) < 4, 0, -10)
    kernel = np.zeros((2, 3, 3, 3))
    kernel[:, :, 1, 1] = 1 / 3
    first = [0, 0, 1, 1, 0, 0, 1, 1]  # biases, scales, means, variances
    return np.concatenate([first, kernel.ravel(), bias, last.ravel()])
