"""Weights as safetensors files, under the tensor names of the published checkpoints."""

from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import whole_file
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu.inference_kernels import BOUNDS

_NETWORKS = {"dgcnn": Dgcnn}
"""By their names in files, which are :data:`DEFAULT` where others wrote them."""
DEFAULT = "dgcnn"


def load_weights(path: Path) -> tuple[Dgcnn, dict[str, str]]:
    """A network in evaluation mode, and what the file says about it (nothing, where others wrote it).

    Number of channels and classes follow from the weights. k stands in the file's metadata, 20 if not.

    Raises:
        InputError: no such file, not safetensors, weights of another network, or numbers that are not finite.
    """
    tensors, metadata = _read(path)
    name = metadata.get("network", DEFAULT)
    if name not in _NETWORKS:
        raise InputError(f"{path}: weights of {name}, not of {' or '.join(_NETWORKS)}")
    k = metadata.get("k", "20")
    if not (k.isdecimal() and len(k) < 5 and 1 <= int(k) <= BOUNDS):
        raise InputError(f"{path}: k = {k:.20}: a point has 1 to {BOUNDS} neighbours")
    try:
        network = _NETWORKS[name].for_weights(tensors, int(k))
    except (KeyError, ValueError) as error:
        raise InputError(f"{path}: not a DGCNN for segmentation: conv1.0.weight or conv9.weight is amiss") from error
    _fill(network, tensors, path)
    return network.eval(), metadata


def save_weights(path: Path, network: Dgcnn, metadata: dict[str, str] | None = None) -> None:
    """Write the weights, with ``metadata`` about them. InputError if that is impossible."""
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in network.published().items()}
    content = save(tensors, {"network": DEFAULT, "k": str(network.k)} | (metadata or {}))
    with whole_file(path) as file:
        file.write_bytes(content)  # safetensors' own files are for their owner's eyes alone


def _fill(network: Dgcnn, tensors: dict[str, Tensor], path: Path) -> None:
    """Copy the tensors into the network; no more and no fewer than it needs."""
    wanted = network.published()
    # The published code registers its batch norms twice, as bn1 and as conv1.1.
    tensors = {name: t for name, t in tensors.items() if not (name[:4] == "conv" and name[5:8] == ".1.")}
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
