"""Labelled point clouds as PLY, which CloudCompare, MeshLab and Open3D read."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.files import whole_file

_POSITION = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
_COLOUR = [("red", "u1"), ("green", "u1"), ("blue", "u1")]
_VERTEX = np.dtype([*_POSITION, *_COLOUR, ("label", "u1")])
_TYPE_NAMES = {np.dtype("<f4"): "float", np.dtype("u1"): "uchar"}


def write_ply(
    path: Path, points: NDArray[np.float32], colours: NDArray[np.uint8], labels: NDArray[np.uint8]
) -> None:
    """Write (N, 3) points with (N, 3) colours and (N,) labels as binary PLY.

    The file appears whole or not at all. InputError if it cannot be written.
    """
    vertices = np.empty(len(points), _VERTEX)
    for (name, _), column in zip(_POSITION, points.T, strict=True):
        vertices[name] = column
    for (name, _), column in zip(_COLOUR, colours.T, strict=True):
        vertices[name] = column
    vertices["label"] = labels
    with whole_file(path) as partial:
        partial.write_bytes(_header(len(points)) + vertices.tobytes())


def _header(count: int) -> bytes:
    properties = [f"property {_TYPE_NAMES[_VERTEX[name]]} {name}" for name in _VERTEX.names or ()]
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {count}",
        *properties,
        "end_header",
        "",
    ]
    return "\n".join(lines).encode()
