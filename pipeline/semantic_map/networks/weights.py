"""Weights as safetensors files, under the tensor names of the published checkpoints."""

from pathlib import Path

from safetensors.torch import save

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.pointcnn import PointCnn
from pipeline.semantic_map.networks.pointnet import PointNet
from pipeline.semantic_map.networks.pointnet2 import PointNet2
from pipeline.semantic_map.networks.pointnext import PointNeXt
from pipeline.semantic_map.networks.tensor_file import copy_tensors, read_tensors

NETWORKS: dict[str, type[PointNetwork]] = {n.NAME: n for n in (PointNet, PointNet2, PointCnn, Dgcnn, PointNeXt)}
"""Networks by their names in files; a file without a name, written by another program, must hold a DGCNN."""


def load_weights(path: Path, network: str | None = None) -> tuple[PointNetwork, dict[str, str]]:
    """A network in evaluation mode, and the file's metadata (empty in files of other programs).

    Args:
        path: the file.
        network: name of the only accepted network; by default, every network is accepted.

    Raises:
        InputError: the file cannot be read, is not safetensors, or holds another network or non-finite numbers.
    """
    tensors, metadata = read_tensors(path)
    name = metadata.get("network", Dgcnn.NAME)
    if name not in ((network,) if network else NETWORKS):
        *others, last = [network] if network else NETWORKS
        wanted = f"{', '.join(others)} or {last}" if others else last
        raise InputError(f"{path}: contains the weights of {name!r:.40}, but must contain those of {wanted}")
    try:
        result = NETWORKS[name].for_weights(tensors, metadata)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    copy_tensors(result.without_duplicates(tensors), result.file_tensors(), path)
    return result.eval(), metadata


def save_weights(path: Path, network: PointNetwork, metadata: dict[str, str] | None = None) -> None:
    """Write weights in half precision, with ``metadata``; InputError if a weight is too large or writing fails."""
    tensors = {name: t.detach().cpu().half().contiguous() for name, t in network.file_tensors().items()}
    for name, tensor in tensors.items():
        if not tensor.isfinite().all():
            raise InputError(
                f"{path}: {name} has values that are NaN or too large for half precision; lower the learning rate"
            )
    content = save(tensors, {"network": network.NAME} | network.metadata() | (metadata or {}))
    with atomic_write(path) as file:
        file.write_bytes(content)  # safetensors' own save_file creates files that only their owner may read
