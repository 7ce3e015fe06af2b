"""Weights of the networks: the shipped safetensors, and Darknet's ``.weights``.

The tensors of the shipped file are named ``layers.N.conv.weight`` and so on, where N counts the layers of both
networks together, as Darknet does: layer 0 copied the image, layers 1 to 24 are the COCO network, and those from 26
on are the arena network. Their convolutions come in the order of :attr:`Yolo.convolutions`.

Darknet's file has a header, then float32 numbers in the order of the layers. The header is three int32 (major, minor,
revision) and the number of images seen, int64 (int32 before version 0.2). Each convolution has, in the order in which
Darknet's ``parser.c`` reads them, its biases, then, if it has batch normalization, scales, means and variances, and
then its kernel (filters, channels per group, size, size).
"""

import struct
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import atomic_write, read_bytes, read_text
from pipeline.semantic_map.networks.tensor_file import copy_tensors, read_tensors
from pipeline.victims.detection.yolo import Convolution, Yolo, YoloSmall, YoloTiny

WRITTEN_VERSION = (0, 2, 5)  # as written by the Darknet that YOLOv3 was published with
NUMBER = np.dtype("<f4")
TENSORS = ("conv.bias", "norm.bias", "norm.weight", "norm.running_mean", "norm.running_var", "conv.weight")
"""The tensors of a convolution, in Darknet's order."""
COCO_LAYERS = (1, 3, 5, 7, 9, 11, 13, 14, 15, 16, 19, 22, 23)
ARENA_LAYERS = (*(26, 27, 28, 29, 30, 32, 33, 34, 36, 37, 38, 40, 41, 42), *(45, 48, 49, 50, 53, 56, 57, 58))
"""Numbers of the convolutions of each network in the shipped file."""


def load_shipped(path: Path) -> tuple[YoloSmall, YoloTiny]:
    """The arena network and the COCO network of the shipped safetensors, in evaluation mode.

    Raises:
        InputError: the file does not exist, belongs to other networks, holds invalid numbers, or does not match the
            hash in the ``.sha256`` file next to it, if any, which has the format of ``sha256sum``.
    """
    check_hash(path)
    with torch.device("meta"):  # no random weights, which would take longer than reading the file
        arena, coco = YoloSmall(), YoloTiny()
    arena.to_empty(device="cpu"), coco.to_empty(device="cpu")
    parts = ((ARENA_LAYERS, arena), (COCO_LAYERS, coco))
    wanted = {
        f"layers.{number}.{name}": tensor
        for numbers, network in parts
        for number, layer in zip(numbers, network.convolutions, strict=True)
        for name, tensor in _tensors(layer)
    }
    tensors = {name: tensor for name, tensor in read_tensors(path)[0].items() if not name.startswith("layers.0.")}
    copy_tensors(tensors, wanted, path)
    return arena.eval(), coco.eval()


def read_weights(path: Path, network: Yolo) -> None:
    """Fill a network from a Darknet file.

    Raises:
        InputError: the file does not exist, does not have the network's length, holds invalid numbers, or
            fails :func:`check_hash`.
    """
    check_hash(path)
    wanted = {f"{i}.{name}": t for i, layer in enumerate(network.convolutions) for name, t in _tensors(layer)}
    counts = [tensor.numel() for tensor in wanted.values()]
    content = read_bytes(path)
    start = header_size(content, path)
    if len(content) != (needed := start + NUMBER.itemsize * sum(counts)):
        raise InputError(
            f"{path}: the file has {len(content)} bytes, but weights of YOLOv3-small for people take {needed}; "
            "use another file"
        )
    numbers = torch.from_numpy(np.frombuffer(content, NUMBER, offset=start).astype(np.float32))
    parts = zip(wanted.items(), numbers.split(counts), strict=True)
    copy_tensors({name: part.view(tensor.shape) for (name, tensor), part in parts}, wanted, path)


def write_weights(path: Path, network: Yolo, seen: int = 0) -> None:
    """Write a network's weights, trained on ``seen`` images, to a Darknet file.

    Raises:
        InputError: the file cannot be written.
    """
    tensors = (tensor for layer in network.convolutions for _, tensor in _tensors(layer))
    header = np.array(WRITTEN_VERSION, "<i4").tobytes() + np.array(seen, "<i8").tobytes()
    with atomic_write(path) as partial:
        partial.write_bytes(header + b"".join(t.detach().cpu().numpy().astype(NUMBER).tobytes() for t in tensors))


def check_hash(path: Path) -> None:
    """Raise InputError if the ``.sha256`` file next to the weights, if any, holds another hash."""
    beside = path.with_name(f"{path.name}.sha256")
    if beside.exists():
        wanted, found = (read_text(beside).split() or [""])[0], sha256(read_bytes(path)).hexdigest()
        if wanted.lower() != found:
            raise InputError(
                f"{path}: the SHA-256 is {found}, which is not the one in {beside.name}; "
                f"replace the weights, or delete {beside.name} if you changed them"
            )


def _tensors(layer: Convolution) -> Iterator[tuple[str, Tensor]]:
    """The names and tensors (not copies) of a convolution, in the order of Darknet's file."""
    named = dict(layer.state_dict(keep_vars=True))
    return ((name, named[name]) for name in TENSORS if name in named)


def header_size(content: bytes, path: Path) -> int:
    """Size of the header of a Darknet file, bytes; InputError if it has none."""
    try:
        major, minor, _ = struct.unpack_from("<iii", content)
    except struct.error as error:
        raise InputError(
            f"{path}: not a Darknet weights file: {len(content)} bytes are too few for the header; use another file"
        ) from error
    if not all(0 <= part < 1000 for part in (major, minor)):  # as in Darknet's parser.c
        raise InputError(
            f"{path}: not a Darknet weights file: its version is {major}.{minor}; both numbers must be from 0 to 999"
        )
    return 20 if 10 * major + minor >= 2 else 16
