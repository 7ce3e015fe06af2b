"""Labelled point clouds as PLY files, which CloudCompare, MeshLab and Open3D read."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Points
from pipeline.errors import InputError
from pipeline.files import MAX_MEMORY, atomic_write, read_bytes

_TYPES = {
    **dict.fromkeys("xyz", "float"),
    **dict.fromkeys(("red", "green", "blue", "label"), "uchar"),
    "scalar_label": "float",  # CloudCompare's name for a scalar field, which it then shows by default
}
VERTEX = np.dtype([(name, {"float": "<f4", "uchar": "u1"}[kind]) for name, kind in _TYPES.items()])


def write_ply(path: Path, points: Points, colours: NDArray[np.uint8], labels: Labels) -> None:
    """Write points with (N, 3) colours and labels as binary PLY.

    The file is written completely or not at all. InputError if it cannot be written.
    """
    vertices = np.empty(len(points), VERTEX)
    for name, column in zip(_TYPES, (*points.T, *colours.T, labels, labels), strict=True):
        vertices[name] = column
    with atomic_write(path) as partial:
        partial.write_bytes(_header(len(points)) + vertices.tobytes())


def read_ply(path: Path) -> NDArray[np.void]:
    """(N,) vertices, with the fields of ``VERTEX``, of a file written by :func:`write_ply`.

    Raises:
        InputError: the file cannot be read, is too large, or was not written by :func:`write_ply`.
    """
    head, end, body = read_bytes(path, MAX_MEMORY).partition(b"end_header\n")
    count, rest = divmod(len(body), VERTEX.itemsize)
    if rest or head + end != _header(count):
        raise InputError(f"{path}: truncated or not written by sarsim; delete it to continue without labels")
    return np.frombuffer(body, VERTEX)


def _header(count: int) -> bytes:
    """The PLY header of a file with ``count`` vertices."""
    properties = [f"property {kind} {name}" for name, kind in _TYPES.items()]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}", *properties, "end_header", ""]
    return "\n".join(lines).encode()
