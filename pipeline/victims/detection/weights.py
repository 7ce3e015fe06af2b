"""Weights of networks: Darknet's ``.weights``, or safetensors.

Darknet's file has a header, then float32 in the order of the layers. The header is three int32 (major, minor,
revision) and the number of images seen, int64 (int32 before version 0.2). Each convolution has, in the order in which
Darknet's ``parser.c`` reads them, its biases, then, if it has batch normalization, scales, means and variances, and
then its kernel (filters, channels of a group, size, size). A safetensors file has the same tensors by the names that
they have in :class:`DarknetNetwork`.
"""

import struct
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import read_bytes, read_text, whole_file
from pipeline.semantic_map.networks.network import whole
from pipeline.semantic_map.networks.tensor_file import copy_tensors, read_tensors
from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.network import DarknetNetwork

WRITTEN_VERSION = (0, 2, 5)  # as the Darknet that published YOLOv3 writes
NUMBER = np.dtype("<f4")
TENSORS = ".safetensors"


def network_files(*files: Path) -> tuple[Path, Path]:
    """The ``.cfg`` and the weights of a network, given both, or the weights alone, beside which the ``.cfg`` lies.

    Raises:
        InputError: a ``.cfg`` alone, or anything else without an ending.
    """
    if not files[1:] and files[0].suffix in ("", ".cfg"):
        raise InputError(f"--detector {files[0]}: give the .cfg and the weights, or .safetensors beside its .cfg")
    return (files[0], files[1]) if files[1:] else (files[0].with_suffix(".cfg"), files[0])


def load_network(*files: Path) -> DarknetNetwork:
    """A network in evaluation mode, from the files of :func:`network_files`.

    Raises:
        InputError: as :meth:`DarknetCfg.read`, :class:`DarknetNetwork` and :func:`read_weights`.
    """
    cfg, weights = network_files(*files)
    network = DarknetNetwork(DarknetCfg.read(cfg))
    read_weights(weights, network)
    return network.eval()


def read_weights(path: Path, network: DarknetNetwork) -> int:
    """Fill a network; returns the number of images that it has seen in training.

    Raises:
        InputError: no such file, too short or too long for the network, numbers that are not finite, or another hash
            than a file beside it has, with the ending ``.sha256``, as ``sha256sum`` writes it.
    """
    _check_hash(path)
    wanted = dict(_tensors(network))
    tensors, seen = _read_tensors(path) if path.suffix == TENSORS else _read_darknet(path, wanted, network.cfg.name)
    copy_tensors(tensors, wanted, path)
    return seen


def write_weights(path: Path, network: DarknetNetwork, seen: int = 0) -> None:
    """Write a network's weights, trained on ``seen`` images; kernels of safetensors in half precision.

    Raises:
        InputError: the file cannot be written.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in _tensors(network)}
    with whole_file(path) as partial:
        if path.suffix == TENSORS:
            small = {name: tensor.half() if tensor.ndim > 1 else tensor for name, tensor in tensors.items()}
            partial.write_bytes(save(small, {"seen": str(seen)}))
            return
        header = np.array(WRITTEN_VERSION, "<i4").tobytes() + np.array(seen, "<i8").tobytes()
        partial.write_bytes(header + b"".join(t.numpy().astype(NUMBER).tobytes() for t in tensors.values()))


def _tensors(network: DarknetNetwork) -> Iterator[tuple[str, Tensor]]:
    """All tensors by name, in the order of Darknet's file, shared with the network."""
    for index, layer in enumerate(network.layers):
        named = dict(layer.state_dict(keep_vars=True))
        for name in ("conv.bias", "norm.bias", "norm.weight", "norm.running_mean", "norm.running_var", "conv.weight"):
            if name in named:
                yield f"layers.{index}.{name}", named[name]


def _check_hash(path: Path) -> None:
    """Raise InputError if a file beside the weights says that they have another SHA-256."""
    beside = path.with_name(f"{path.name}.sha256")
    if beside.exists():
        wanted, found = (read_text(beside).split() or [""])[0], sha256(read_bytes(path)).hexdigest()
        if wanted.lower() != found:
            raise InputError(f"{path}: SHA-256 {found}, not {wanted:.80} as {beside.name} has it: damaged?")


def _read_tensors(path: Path) -> tuple[dict[str, Tensor], int]:
    """The tensors of a safetensors file, and number of images seen; 0 if it has none."""
    tensors, metadata = read_tensors(path)
    return tensors, whole(metadata.get("seen", ""))


def _read_darknet(path: Path, wanted: dict[str, Tensor], name: str) -> tuple[dict[str, Tensor], int]:
    """The tensors of Darknet's file, for those ``wanted`` by the network ``name``, and number of images seen."""
    content = read_bytes(path)
    seen, start = _read_header(content, path)
    counts = [tensor.numel() for tensor in wanted.values()]
    needed = start + NUMBER.itemsize * sum(counts)
    if len(content) != needed:
        which = "short" if len(content) < needed else "long"
        raise InputError(f"{path}: {len(content)} bytes, too {which} for {name}, which needs {needed}")
    numbers = torch.tensor(np.frombuffer(content, NUMBER, offset=start))
    parts = zip(wanted.items(), numbers.split(counts), strict=True)
    return {name: part.view(tensor.shape) for (name, tensor), part in parts}, seen


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
