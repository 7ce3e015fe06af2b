"""Scores how well the topological map's nodes and edges represent the true environment."""

from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import MaskLayer
from pipeline.geometry.sight_kernels import cells_in_sight, line_is_free
from pipeline.topological_map.cover_kernels import count_in
from pipeline.topological_map.topological_map import TopologicalMap
from sarsim.ground_truth.true_surface import CELL, GroundTruthSurface

SIGHT_RANGE = 2.0  # m, maximum distance at which a node covers a cell that it sees
MIN_GAIN = 0.01  # m², minimum gain of a node of the greedy cover


def score_topology(topology: TopologicalMap, truth: GroundTruthSurface) -> dict[str, Any]:
    """Size, soundness and coverage of a topological map, and its size relative to a greedy cover."""
    positions = np.array([node.position[:2] for node in topology.nodes.values()]).reshape(-1, 2)
    ways = [topology.edge_path(a, b)[:, :2] for a, b in topology.graph.edges]
    grid, free = truth.grid, ~truth.walls
    through = sum(
        not all(line_is_free(*a, *b, grid.origin, grid.cell, free) for a, b in pairwise(way)) for way in ways
    )
    seen = _seen_from(positions, truth)
    greedy = _greedy_cover(truth, seen)
    return {
        "nodes": len(topology.nodes),
        "edges": len(ways),
        "components": nx.number_connected_components(topology.graph),
        "edges_through_walls": through,
        "coverage": float(seen[truth.drivable].mean()),
        "nodes_vs_greedy": len(topology.nodes) / max(greedy, 1),
    }


def _seen_from(positions: NDArray[np.float64], truth: GroundTruthSurface) -> MaskLayer:
    """(nx, ny) bool, the drivable cells that are seen from nodes at positions (P, 2) m."""
    seen = np.zeros(truth.grid.shape, np.bool_)
    for window, corner in zip(*_views(positions, truth.drivable, truth), strict=True):
        seen[tuple((np.argwhere(window) + corner).T)] = True
    return seen


def _views(
    places: NDArray[np.float64], target: NDArray[np.bool_], truth: GroundTruthSurface
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """The cells of a target (nx, ny) seen from places (K, 2), m, as returned by :func:`cells_in_sight`."""
    grid = truth.grid
    return cells_in_sight(places, target, grid.origin, grid.cell, SIGHT_RANGE, ~truth.walls)


def _greedy_cover(truth: GroundTruthSurface, area: NDArray[np.bool_]) -> int:
    """Number of nodes of a greedy cover of an area (nx, ny), chosen from every fourth drivable cell along x and y."""
    cells = np.argwhere(truth.drivable)
    fourth = cells[(cells % 4 == 0).all(axis=1)]
    cells = fourth if len(fourth) else cells
    # Cells farther away see none of the area.
    is_near = truth.grid.distance_to(area)[tuple(cells.T)] <= SIGHT_RANGE + CELL
    seen, corners = _views(truth.grid.centre_of(cells[is_near]), area, truth)
    missing, nodes = area.copy(), 0
    gain = count_in(seen, corners, missing)
    while gain.max(initial=0) * CELL**2 >= MIN_GAIN:
        best = int(gain.argmax())
        missing[tuple((np.argwhere(seen[best]) + corners[best]).T)] = False
        beside = (np.abs(corners - corners[best]) < seen.shape[1]).all(axis=1)  # the gains of others stay the same
        gain[beside] = count_in(seen[beside], corners[beside], missing)
        nodes += 1
    return nodes
