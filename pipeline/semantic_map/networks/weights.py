"""Weights as safetensors files, under the tensor names of the published checkpoints."""

from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import check_regular, whole_file
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.network import PointNetwork
from pipeline.semantic_map.networks.pointcnn import PointCnn
from pipeline.semantic_map.networks.pointnet import PointNet
from pipeline.semantic_map.networks.pointnet2 import PointNet2
from pipeline.semantic_map.networks.pointnext import PointNeXt

NETWORKS: dict[str, type[PointNetwork]] = {n.NAME: n for n in (PointNet, PointNet2, PointCnn, Dgcnn, PointNeXt)}
"""By their names in files; a file of another program has no such name and holds a DGCNN."""


def load_weights(path: Path, network: str | None = None) -> tuple[PointNetwork, dict[str, str]]:
    """A network in evaluation mode, and the file's metadata (empty in files of other programs).

    Args:
        path: of the file.
        network: name of the only network that is accepted; any if not given.

    Raises:
        InputError: no such file, not safetensors, weights of another network, or numbers that are not finite.
    """
    tensors, metadata = _read(path)
    name = metadata.get("network", Dgcnn.NAME)
    if name not in ((network,) if network else NETWORKS):
        raise InputError(f"{path}: weights of {name:.40}, not of {network or ' or '.join(NETWORKS)}")
    try:
        result = NETWORKS[name].for_weights(tensors, metadata)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    _fill(result, tensors, path)
    return result.eval(), metadata


def save_weights(path: Path, network: PointNetwork, metadata: dict[str, str] | None = None) -> None:
    """Write the weights in half precision, and ``metadata`` about them. InputError if that is impossible."""
    tensors = {name: t.detach().cpu().half().contiguous() for name, t in network.published().items()}
    for name, tensor in tensors.items():
        if not tensor.isfinite().all():
            raise InputError(f"{path}: {name} is too large for half precision: lower the learning rate")
    content = save(tensors, {"network": network.NAME} | network.about() | (metadata or {}))
    with whole_file(path) as file:
        file.write_bytes(content)  # safetensors' own save_file makes files that only their owner may read


def _fill(network: PointNetwork, tensors: dict[str, Tensor], path: Path) -> None:
    """Copy the tensors into the network; InputError if they are not exactly those that it needs."""
    wanted, tensors = network.published(), network.file_names(tensors)
    _refuse(sorted(wanted.keys() - tensors.keys()), "missing", path)
    _refuse(sorted(tensors.keys() - wanted.keys()), "unknown", path)
    for name, tensor in tensors.items():
        if tensor.shape != wanted[name].shape:
            shapes = f"{tuple(tensor.shape)} instead of {tuple(wanted[name].shape)}"
            raise InputError(f"{path}: weights of another network: {name} is {shapes}")
        if tensor.is_complex() or not tensor.double().isfinite().all():
            raise InputError(f"{path}: {name} holds numbers that are not finite or not real")
        if name.endswith("running_var") and tensor.double().min() < 0:
            raise InputError(f"{path}: {name} holds variances below 0")
        wanted[name].copy_(tensor)


def _refuse(names: list[str], what: str, path: Path) -> None:
    if names:
        others = f" and {len(names) - 1} more" if names[1:] else ""
        raise InputError(f"{path}: weights of another network: {names[0]}{others} {what}")


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    check_regular(path)
    try:
        with path.open("rb") as start:
            magic = start.read(2)
        if magic in (b"PK", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"):
            raise InputError(f"{path}: a pickle, which could run code: have it converted to safetensors")
        with safe_open(path, framework="pt") as file:
            names = file.keys()
            return {name: file.get_tensor(name) for name in names}, file.metadata() or {}
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except SafetensorError as error:
        raise InputError(f"{path}: not a whole safetensors file: {' '.join(str(error).split())}") from error
