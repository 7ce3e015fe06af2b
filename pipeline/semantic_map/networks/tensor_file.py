"""Reads the tensors of a safetensors file from an untrusted source."""

from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from pipeline.errors import InputError
from pipeline.files import check_regular


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """The tensors of a file by name, of any shape, and its metadata (empty in files of other programs).

    Raises:
        InputError: the file cannot be read, is a pickle, or is not a complete safetensors file.
    """
    check_regular(path)
    try:
        with path.open("rb") as start:
            length, header = start.read(8), start.read(1)
        # The length of a safetensors header may look like the first bytes of a pickle.
        if length[:2] in (b"PK", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05") and header != b"{":
            raise InputError(f"{path}: a pickle file can run code and is not accepted; convert it to safetensors")
        with safe_open(path, framework="pt") as file:
            names = file.keys()
            return {name: file.get_tensor(name) for name in names}, file.metadata() or {}
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except SafetensorError as error:
        said = " ".join(str(error).split())
        raise InputError(
            f"{path}: not a complete safetensors file ({said}); replace it with an intact one"
        ) from error


@torch.no_grad()
def copy_tensors(tensors: Mapping[str, Tensor], wanted: Mapping[str, Tensor], path: Path) -> None:
    """Copy the tensors of a file, of any precision, into the ``wanted`` tensors with the same names and shapes.

    Raises:
        InputError: names or shapes differ, or a tensor contains invalid numbers; the message names ``path``.
    """
    _refuse(sorted(wanted.keys() - tensors.keys()), "missing", path)
    _refuse(sorted(tensors.keys() - wanted.keys()), "unexpected", path)
    for name, tensor in tensors.items():
        if tensor.shape != wanted[name].shape:
            shapes = f"has shape {tuple(tensor.shape)}, but must have {tuple(wanted[name].shape)}"
            raise InputError(f"{path}: the weights do not fit the network ({name} {shapes}); use another file")
        if tensor.is_complex() or not tensor.double().isfinite().all():
            raise InputError(f"{path}: {name} contains complex, NaN or infinite values; use another file")
        if name.endswith("running_var") and (least := float(tensor.double().min())) < 0:
            raise InputError(f"{path}: {name} contains the variance {least:g}; variances must be non-negative")
        wanted[name].copy_(tensor)


def _refuse(names: list[str], what: str, path: Path) -> None:
    if names:
        tensors = f"tensors: {names[0]} and {len(names) - 1} more" if names[1:] else f"tensor: {names[0]}"
        raise InputError(f"{path}: the weights do not fit the network ({what} {tensors}); use another file")
