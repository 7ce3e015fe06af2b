"""How well nodes and edges express the true environment."""

from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.surface.path_kernels import free_rules, lines_are_drivable
from pipeline.topological_map.topological_map import TopologicalMap
from sarsim.scoring.true_surface import TrueSurface

SIGHT = 2.0
"""m from which a node covers a cell that it sees."""


def score_topology(topology: TopologicalMap, truth: TrueSurface) -> dict[str, Any]:
    """Size, soundness and coverage of a topological map, and its size against a greedy cover."""
    positions = np.array([node.position[:2] for node in topology.nodes.values()]).reshape(-1, 2)
    edges = [(topology.nodes[a].position, topology.nodes[b].position) for a, b in topology.graph.edges]
    through = sum(not _in_sight(truth, a[None, :2], b[None, :2])[0] for a, b in edges)
    cells = truth.grid.centre_of(np.argwhere(truth.drivable))
    covered = np.zeros(len(cells), np.bool_)
    for position in positions:
        covered |= _covered_by(position, cells, truth)
    greedy = _greedy_cover(cells, truth, float(covered.mean()))
    return {
        "nodes": len(topology.nodes),
        "edges": len(edges),
        "components": nx.number_connected_components(topology.graph),
        "edges_through_walls": int(through),
        "coverage": float(covered.mean()),
        "nodes_vs_greedy": len(topology.nodes) / max(greedy, 1),
    }


def _in_sight(
    truth: TrueSurface, starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(N,) whether no wall stands between points (N, 2)."""
    grid = truth.grid
    return lines_are_drivable(starts, ends, grid.origin, grid.cell, free_rules(~truth.walls))


def _covered_by(
    position: NDArray[np.float64], cells: NDArray[np.float64], truth: TrueSurface
) -> NDArray[np.bool_]:
    """(N,) which of the cells see a node within ``SIGHT``."""
    near = np.linalg.norm(cells - position, axis=1) <= SIGHT
    result = np.zeros(len(cells), np.bool_)
    result[near] = _in_sight(truth, np.repeat(position[None], near.sum(), axis=0), cells[near])
    return result


def _greedy_cover(cells: NDArray[np.float64], truth: TrueSurface, share: float) -> int:
    """Nodes that a greedy cover by drivable cells, every fourth along x and y, needs for the same share of cells."""
    index = truth.grid.cell_of(cells)
    candidates = cells[(index % 4 == 0).all(axis=1)]
    sees = np.array([_covered_by(c, cells, truth) for c in candidates])
    covered = np.zeros(len(cells), np.bool_)
    nodes = 0
    while covered.mean() < share:
        gain = (sees & ~covered).sum(axis=1)
        if gain.max() == 0:
            break
        covered |= sees[gain.argmax()]
        nodes += 1
    return nodes
