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
            magic = start.read(2)
        if magic in (b"PK", b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"):
            raise InputError(f"{path}: a pickle, which could run code; convert it to safetensors")
        with safe_open(path, framework="pt") as file:
            names = file.keys()
            return {name: file.get_tensor(name) for name in names}, file.metadata() or {}
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except SafetensorError as error:
        raise InputError(f"{path}: not a complete safetensors file: {' '.join(str(error).split())}") from error


@torch.no_grad()
def copy_tensors(tensors: Mapping[str, Tensor], wanted: Mapping[str, Tensor], path: Path) -> None:
    """Copy the tensors of a file, of any precision, into the ``wanted`` ones with the same names and shapes.

    Raises:
        InputError: names or shapes differ, or a tensor holds impossible numbers; the message names ``path``.
    """
    _refuse(sorted(wanted.keys() - tensors.keys()), "missing", path)
    _refuse(sorted(tensors.keys() - wanted.keys()), "unknown", path)
    for name, tensor in tensors.items():
        if tensor.shape != wanted[name].shape:
            shapes = f"{tuple(tensor.shape)} instead of {tuple(wanted[name].shape)}"
            raise InputError(f"{path}: weights of another network: {name} is {shapes}")
        if tensor.is_complex() or not tensor.double().isfinite().all():
            raise InputError(f"{path}: {name} must hold finite real numbers")
        if name.endswith("running_var") and tensor.double().min() < 0:
            raise InputError(f"{path}: {name} holds negative variances")
        wanted[name].copy_(tensor)


def _refuse(names: list[str], what: str, path: Path) -> None:
    if names:
        others = f" and {len(names) - 1} more" if names[1:] else ""
        raise InputError(f"{path}: weights of another network: {names[0]}{others} {what}")
