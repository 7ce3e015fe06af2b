"""Octrees as files of OctoMap: ``.bt``, free and occupied alone, and ``.ot`` with log-odds and colours.

Formats as written by OctoMap 1.10 (Hornung et al., "OctoMap: an efficient probabilistic 3D mapping framework based on
octrees", 2013). OctoMap knows no offset of the grid: voxel (i, j, k) is written as OctoMap's voxel (i, j, k), and the
header has a comment with the place of its corner, which this module reads and OctoMap passes over.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import whole_file
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.io.octree import DEPTH, Octree
from pipeline.metric_map.io.octree_kernels import (
    FREE_CHILD,
    INNER_CHILD,
    OCCUPIED_CHILD,
    decode_bt,
    decode_ot,
)
from pipeline.metric_map.metric_map import LOG_ODDS, MetricMapConfig

_BINARY, _FULL = "# Octomap OcTree binary file", "# Octomap OcTree file"
_NOTE = "# (feel free to add / change comments, but leave the first line as it is!)"
_PLAIN_NODE = np.dtype([("log_odds", "<f4"), ("children", "u1")])
_COLOUR_NODE = np.dtype([("log_odds", "<f4"), ("colour", "u1", 3), ("children", "u1")])
_NODES = {"OcTree": _PLAIN_NODE, "ColorOcTree": _COLOUR_NODE}
_FREE, _OCCUPIED = MetricMapConfig.least, MetricMapConfig.greatest
"""Log-odds, in units of the metric map, of the leaves of a ``.bt`` file: like OctoMap's, as sure as can be."""
_NO_COLOUR = 255
"""White stands for a node without a colour."""


def write_bt(path: Path, octree: Octree) -> None:
    """Write which space is free and which is occupied.

    Raises:
        InputError: if the file cannot be written.
    """
    nodes = _nodes(octree.binary(_FREE, _OCCUPIED))
    inner = nodes.children != 0
    _write(path, _BINARY, "OcTree", octree, nodes, nodes.kinds[inner].astype("<u2").tobytes())


def write_ot(path: Path, octree: Octree) -> None:
    """Write the log-odds of free and occupied space, coloured by semantic class.

    Raises:
        InputError: if the file cannot be written.
    """
    nodes = _nodes(octree)
    records = np.empty(len(nodes.children), _COLOUR_NODE)
    records["log_odds"], records["colour"], records["children"] = nodes.log_odds, nodes.colour, nodes.children
    _write(path, _FULL, "ColorOcTree", octree, nodes, records.tobytes())


def read_octomap(path: Path) -> Octree:
    """Read a ``.bt`` file, or an ``.ot`` file with or without colours.

    A colour that is none of the labels' counts as unlabelled.

    Raises:
        InputError: if the file cannot be read, is damaged or holds another kind of tree.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    header = _Header.parse(path, content)
    data = np.frombuffer(content, np.uint8, offset=header.length)
    if not len(data):
        empty = np.zeros(0, np.int64)
        return Octree(
            header.resolution, header.corner, empty, empty, empty.astype(np.int8), empty.astype(np.uint8)
        )
    leaves, log_odds, label = (
        _decode_binary(data) if header.is_binary else _decode_full(data, _NODES[header.kind])
    )
    if log_odds is None:
        raise InputError(f"{path}: the tree is damaged")
    return Octree(header.resolution, header.corner, leaves[:, 0], leaves[:, 1], log_odds, label)


@dataclass(frozen=True, eq=False)
class _Nodes:
    """All nodes of a tree, depth first.

    Attributes:
        log_odds: (N,) float32; of an inner node the greatest of its children.
        colour: (N, 3) uint8; of an inner node the mean of its coloured children.
        children: (N,) uint8, a bit for each child; 0 = a leaf.
        kinds: (N,) int64, two bits for each child: what ``.bt`` says of it.
    """

    log_odds: NDArray[np.float32]
    colour: NDArray[np.uint8]
    children: NDArray[np.uint8]
    kinds: NDArray[np.int64]


Level = dict[str, NDArray[Any]]
"""The nodes of one size by columns: those of _Nodes, ``code``, and ``kind``, what ``.bt`` says of the node."""


def _nodes(octree: Octree) -> _Nodes:
    """Build the inner nodes from the leaves up and put all nodes in order."""
    levels = [_leaves(octree, 0)]
    for level in range(1, DEPTH + 1):
        nodes = _leaves(octree, level)
        if len(levels[-1]["code"]):
            inner = _parents(levels[-1])
            nodes = {name: np.concatenate([column, inner[name]]) for name, column in nodes.items()}
        order = np.argsort(nodes["code"])
        levels.append({name: column[order] for name, column in nodes.items()})
    return _depth_first(levels)


def _leaves(octree: Octree, level: int) -> Level:
    here = np.flatnonzero(octree.level == level)
    here = here[np.argsort(octree.code[here])]
    occupied, nothing = octree.log_odds[here] > 0, np.zeros(len(here), np.uint8)
    return {
        "code": octree.code[here],
        "log_odds": (octree.log_odds[here] * LOG_ODDS).astype(np.float32),
        "colour": np.where(occupied[:, None], COLOURS[octree.label[here]], np.uint8(_NO_COLOUR)),
        "children": nothing,
        "kinds": nothing.astype(np.int64),
        "kind": np.where(occupied, OCCUPIED_CHILD, FREE_CHILD),
    }


def _parents(nodes: Level) -> Level:
    """The inner nodes above the nodes of a level, which are sorted by code and not none."""
    code, first = np.unique(nodes["code"] >> 3, return_index=True)
    child = nodes["code"] & 7
    coloured = (nodes["colour"] != _NO_COLOUR).any(axis=1)
    sums = np.add.reduceat(nodes["colour"].astype(np.int64) * coloured[:, None], first)
    counts = np.add.reduceat(coloured.astype(np.int64), first)[:, None]
    return {
        "code": code,
        "log_odds": np.maximum.reduceat(nodes["log_odds"], first),
        "colour": np.where(counts > 0, sums // np.maximum(counts, 1), _NO_COLOUR).astype(np.uint8),
        "children": np.bitwise_or.reduceat(1 << child, first).astype(np.uint8),
        "kinds": np.bitwise_or.reduceat(nodes["kind"] << (2 * child), first),
        "kind": np.full(len(code), INNER_CHILD),
    }


def _depth_first(levels: list[Level]) -> _Nodes:
    """A node stands before all that it contains: order by the first voxel, the larger node first."""
    first = np.concatenate([nodes["code"] << (3 * level) for level, nodes in enumerate(levels)])
    level = np.concatenate([np.full(len(nodes["code"]), level) for level, nodes in enumerate(levels)])
    order = np.lexsort((-level, first))
    columns = ("log_odds", "colour", "children", "kinds")
    return _Nodes(*(np.concatenate([nodes[name] for nodes in levels])[order] for name in columns))


def _write(path: Path, title: str, kind: str, octree: Octree, nodes: _Nodes, data: bytes) -> None:
    corner = " ".join(repr(value) for value in octree.corner.tolist())
    header = [
        title,
        _NOTE,
        f"# corner {corner}",
        f"id {kind}",
        f"size {len(nodes.children)}",
        f"res {octree.voxel_size!r}",
        "data",
    ]
    with whole_file(path) as partial:
        partial.write_bytes("\n".join([*header, ""]).encode() + data)


@dataclass(frozen=True, eq=False)
class _Header:
    """What stands before the data; ``length`` in bytes."""

    is_binary: bool
    kind: str
    resolution: float
    corner: NDArray[np.float64]
    length: int

    @classmethod
    def parse(cls, path: Path, content: bytes) -> "_Header":
        """Read the lines up to ``data``."""
        text, mark, _ = content.partition(b"\ndata\n")
        lines = text.decode("latin-1").split("\n")
        if not mark or lines[0] not in (_BINARY, _FULL):
            raise InputError(f"{path}: not a file of OctoMap")
        fields = dict(line.removeprefix("# ").partition(" ")[::2] for line in lines[1:])
        kind = fields.get("id", "")
        if kind not in _NODES or (lines[0] == _BINARY and kind != "OcTree"):
            raise InputError(f"{path}: a tree of kind {kind!r} cannot be read")
        try:
            resolution = float(fields["res"])
            corner = np.array([float(word) for word in fields.get("corner", "0 0 0").split()])
        except (KeyError, ValueError) as error:
            raise InputError(f"{path}: the header has no proper 'res' or 'corner'") from error
        if not 0 < resolution < np.inf or corner.shape != (3,) or not np.isfinite(corner).all():
            raise InputError(f"{path}: the header has no proper 'res' or 'corner'")
        return cls(lines[0] == _BINARY, kind, resolution, corner, len(text) + len(mark))


def _decode_binary(
    data: NDArray[np.uint8],
) -> tuple[NDArray[np.int64], NDArray[np.int8] | None, NDArray[np.uint8]]:
    """Leaves, log-odds at the clamps, and labels; None for the log-odds of a damaged tree."""
    leaves = np.empty((4 * len(data), 3), np.int64)
    count = decode_bt(data, DEPTH, leaves)
    leaves, label = leaves[: max(count, 0)], np.zeros(max(count, 0), np.uint8)
    if count < 0:
        return leaves, None, label
    log_odds = np.where(leaves[:, 2] == OCCUPIED_CHILD, _OCCUPIED, _FREE).astype(np.int8)
    return leaves, log_odds, label


def _decode_full(
    data: NDArray[np.uint8], node: np.dtype
) -> tuple[NDArray[np.int64], NDArray[np.int8] | None, NDArray[np.uint8]]:
    """Leaves, log-odds, and labels by colour; None for the log-odds of a damaged tree."""
    leaves = np.empty((len(data) // node.itemsize, 3), np.int64)
    count = decode_ot(data, DEPTH, node.itemsize, leaves)
    leaves, label = leaves[: max(count, 0)], np.zeros(max(count, 0), np.uint8)
    if count < 0:
        return leaves, None, label
    records = data.view(node)[leaves[:, 2]]
    if not np.isfinite(records["log_odds"]).all():
        return leaves, None, label
    units = records["log_odds"] / LOG_ODDS
    # Rounding must not turn a weak belief into none.
    log_odds = np.copysign(np.clip(np.rint(np.abs(units)), 1, 127), units) * (units != 0)
    if "colour" in (node.names or ()):
        for value in Label:
            label[(records["colour"] == COLOURS[value]).all(axis=1)] = value
    return leaves, log_odds.astype(np.int8), label
