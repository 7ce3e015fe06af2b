"""Darknet's ``.weights``: a header, then float32 in the order of the layers.

The header is three int32 (major, minor, revision) and the number of images seen, int64 (int32 before version 0.2).
Each convolution has, in the order in which Darknet's ``parser.c`` reads them, its biases, then, if it has batch
normalization, scales, means and variances, and then its kernel (filters, channels, size, size).
"""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import read_bytes, whole_file
from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.network import DarknetNetwork

WRITTEN_VERSION = (0, 2, 5)  # as the Darknet that published YOLOv3 writes
NUMBER = np.dtype("<f4")


def load_network(cfg: Path, weights: Path) -> DarknetNetwork:
    """A network in evaluation mode.

    Raises:
        InputError: as :meth:`DarknetCfg.read`, :class:`DarknetNetwork` and :func:`read_weights`.
    """
    network = DarknetNetwork(DarknetCfg.read(cfg))
    read_weights(weights, network)
    return network.eval()


def read_weights(path: Path, network: DarknetNetwork) -> int:
    """Fill a network; returns the number of images that it has seen in training.

    Raises:
        InputError: no such file, too short or too long for the network, or numbers that are not finite.
    """
    content = read_bytes(path)
    seen, start = _read_header(content, path)
    tensors = list(_tensors(network))
    needed = start + NUMBER.itemsize * sum(tensor.numel() for tensor in tensors)
    if len(content) != needed:
        which, name = "short" if len(content) < needed else "long", network.cfg.name
        raise InputError(f"{path}: {len(content)} bytes, too {which} for {name}, which needs {needed}")
    numbers = np.frombuffer(content, NUMBER, offset=start)
    if not np.isfinite(numbers).all():
        raise InputError(f"{path}: holds numbers that are not finite")
    ends = np.cumsum([tensor.numel() for tensor in tensors])
    variances = {id(layer.norm.running_var) for layer in network.convolutions if layer.norm is not None}
    with torch.no_grad():
        for tensor, part in zip(tensors, np.split(numbers, ends[:-1]), strict=True):
            if id(tensor) in variances and part.min() < 0:
                raise InputError(f"{path}: holds variances below 0")
            tensor.copy_(torch.tensor(part).view(tensor.shape))
    return seen


def write_weights(path: Path, network: DarknetNetwork, seen: int = 0) -> None:
    """Write a network's weights, trained on ``seen`` images. InputError if the file cannot be written."""
    with whole_file(path) as partial, partial.open("wb") as file:
        file.write(np.array(WRITTEN_VERSION, "<i4").tobytes() + np.array(seen, "<i8").tobytes())
        for tensor in _tensors(network):
            file.write(tensor.detach().cpu().contiguous().numpy().astype(NUMBER).tobytes())


def _tensors(network: DarknetNetwork) -> Iterator[Tensor]:
    """All tensors of the file, in its order, shared with the network."""
    for layer in network.convolutions:
        if layer.norm is None:
            assert layer.conv.bias is not None
            yield layer.conv.bias
        else:
            mean, variance = layer.norm.running_mean, layer.norm.running_var
            assert mean is not None and variance is not None
            yield from (layer.norm.bias, layer.norm.weight, mean, variance)
        yield layer.conv.weight


def _read_header(content: bytes, path: Path) -> tuple[int, int]:
    """Number of images that the network has seen in training, and number of bytes of the header."""
    try:
        major, minor, revision = struct.unpack_from("<iii", content)
        header = struct.Struct("<iiiq" if (major, minor) >= (0, 2) else "<iiii")
        seen = header.unpack_from(content)[-1]
    except struct.error as error:
        raise InputError(f"{path}: {len(content)} bytes, too short for Darknet weights") from error
    if not all(0 <= part < 1000 for part in (major, minor)):  # as Darknet's parser.c
        raise InputError(f"{path}: not Darknet weights: version {major}.{minor}.{revision}")
    return seen, header.size
