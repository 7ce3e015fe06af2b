"""Labelled point clouds as PLY, which CloudCompare, MeshLab and Open3D read."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.files import whole_file

_TYPES = {"x": "float", "y": "float", "z": "float"} | dict.fromkeys(("red", "green", "blue", "label"), "uchar")
_VERTEX = np.dtype([(name, {"float": "<f4", "uchar": "u1"}[kind]) for name, kind in _TYPES.items()])


def write_ply(path: Path, points: NDArray[np.float32], colours: NDArray[np.uint8], labels: NDArray[np.uint8]) -> None:
    """Write (N, 3) points in m with (N, 3) colours and (N,) labels as binary PLY.

    The file appears whole or not at all. InputError if it cannot be written.
    """
    vertices = np.empty(len(points), _VERTEX)
    for name, column in zip(_TYPES, (*points.T, *colours.T, labels), strict=True):
        vertices[name] = column
    properties = [f"property {kind} {name}" for name, kind in _TYPES.items()]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *properties, "end_header"]
    with whole_file(path) as partial:
        partial.write_bytes("\n".join([*header, ""]).encode() + vertices.tobytes())
