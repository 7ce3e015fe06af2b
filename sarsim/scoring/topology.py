"""How well nodes and edges express the true environment."""

from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from pipeline.surface.path_kernels import free_rules, lines_are_drivable
from pipeline.topological_map.topological_map import TopologicalMap
from sarsim.scoring.true_surface import CELL, TrueSurface

SIGHT = 2.0
"""m from which a node covers a cell that it sees."""
MIN_GAIN = 0.01
"""m²; less is not worth a node of the greedy cover."""


def score_topology(topology: TopologicalMap, truth: TrueSurface) -> dict[str, Any]:
    """Size, soundness and coverage of a topological map, and its size against a greedy cover."""
    positions = np.array([node.position[:2] for node in topology.nodes.values()]).reshape(-1, 2)
    ways = [topology.way(a, b)[:, :2] for a, b in topology.graph.edges]
    through = sum(not _in_sight(truth, way[:-1], way[1:]).all() for way in ways)
    cells = truth.grid.centre_of(np.argwhere(truth.drivable))
    seen = _cells_seen(positions, cells, truth).sum(axis=0) > 0
    greedy = _greedy_cover(cells, truth, seen)
    return {
        "nodes": len(topology.nodes),
        "edges": len(ways),
        "components": nx.number_connected_components(topology.graph),
        "edges_through_walls": through,
        "coverage": float(seen.mean()),
        "nodes_vs_greedy": len(topology.nodes) / max(greedy, 1),
    }


def _in_sight(
    truth: TrueSurface, starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(N,) whether no wall stands between points (N, 2)."""
    grid = truth.grid
    return lines_are_drivable(starts, ends, grid.origin, grid.cell, free_rules(~truth.walls))


def _cells_seen(positions: NDArray[np.float64], cells: NDArray[np.float64], truth: TrueSurface) -> csr_array:
    """(P, N) 1 where a node at position p would see cell n within ``SIGHT``, else 0."""
    near = KDTree(cells).query_ball_point(positions, SIGHT) if len(positions) else []
    rows = np.repeat(np.arange(len(positions)), [len(n) for n in near])
    columns = np.concatenate([np.asarray(n, np.int64) for n in near] or [np.zeros(0, np.int64)])
    sees = _in_sight(truth, positions[rows], cells[columns])
    return csr_array(
        (np.ones(sees.sum(), np.int32), (rows[sees], columns[sees])), (len(positions), len(cells))
    )


def _greedy_cover(cells: NDArray[np.float64], truth: TrueSurface, area: NDArray[np.bool_]) -> int:
    """Nodes that a greedy cover by every fourth drivable cell along x and y needs for an area: (N,) of the cells."""
    candidates = cells[(truth.grid.cell_of(cells) % 4 == 0).all(axis=1)]
    if not len(candidates):
        candidates = cells
    sees = _cells_seen(candidates, cells, truth)
    missing = area.astype(np.int32)
    nodes = 0
    while True:
        gain = sees @ missing
        best = int(gain.argmax())
        if gain[best] * CELL**2 < MIN_GAIN:
            return nodes
        missing[sees.indices[sees.indptr[best] : sees.indptr[best + 1]]] = 0
        nodes += 1
