"""Labelled point clouds as PLY, which CloudCompare, MeshLab and Open3D read."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

_TYPE_NAMES = {"<f4": "float", "|u1": "uchar"}
_VERTEX = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("red", "u1"),
        ("green", "u1"),
        ("blue", "u1"),
        ("label", "u1"),
    ]
)


def write_ply(
    path: Path, points: NDArray[np.float32], colours: NDArray[np.uint8], labels: NDArray[np.uint8]
) -> None:
    """Write a binary PLY of (N, 3) points with (N, 3) colours and (N,) labels.

    The file appears whole or not at all. InputError if it cannot be written.
    """
    vertices = np.empty(len(points), _VERTEX)
    for names, columns in ((("x", "y", "z"), points), (("red", "green", "blue"), colours)):
        for name, column in zip(names, columns.T, strict=True):
            vertices[name] = column
    vertices["label"] = labels
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_bytes(_header(len(points)) + vertices.tobytes())
        os.replace(partial, path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from error


def _header(count: int) -> bytes:
    properties = [f"property {_TYPE_NAMES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()]
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {count}",
        *properties,
        "end_header",
        "",
    ]
    return "\n".join(lines).encode()
