from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest

from pipeline.geometry.sight_kernels import cells_in_sight
from pipeline.grid_map import Grid
from pipeline.labels import Label
from pipeline.topological_map.cover_kernels import count_in
from pipeline.topological_map.node_set import Node
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.scoring.topology import MIN_GAIN, SIGHT_RANGE, score_topology
from sarsim.scoring.topology_kernels import shortest_path_length


@pytest.fixture
def two_rooms():
    """4 × 2 m, a wall in the middle with a door of 0.6 m at its north end."""
    grid = Grid(np.zeros(2, np.int64), 0.05, (80, 40))
    walls = np.zeros(grid.shape, np.bool_)
    walls[40, :28] = True
    return GroundTruthSurface(grid, np.zeros(grid.shape), ~walls, walls)


def topology_of(positions, edges):
    nodes = {n: Node(n, Label.TERRAIN, np.array([*p, 0.0])) for n, p in enumerate(positions)}
    graph = nx.Graph(edges)
    graph.add_nodes_from(nodes)
    return SimpleNamespace(
        nodes=nodes, graph=graph, edge_path=lambda a, b: np.array([nodes[a].position, nodes[b].position])
    )


def test_edges_through_walls_are_counted(two_rooms):
    positions = [(1, 0.5), (3, 0.5), (2.02, 1.7)]
    sound = score_topology(topology_of(positions, [(0, 2), (1, 2)]), two_rooms)
    assert (sound["edges_through_walls"], sound["components"], sound["edges"]) == (0, 1, 2)
    crossing = score_topology(topology_of(positions, [(0, 1), (1, 2)]), two_rooms)
    assert crossing["edges_through_walls"] == 1
    assert score_topology(topology_of(positions, [(0, 2)]), two_rooms)["components"] == 2


def test_coverage_is_what_nodes_see_within_two_metres(two_rooms):
    left = score_topology(topology_of([(1, 1)], []), two_rooms)
    assert 0.5 < left["coverage"] < 0.65
    both = score_topology(topology_of([(1, 1), (3, 1)], []), two_rooms)
    assert both["coverage"] > 0.99


def test_more_nodes_than_needed_show_in_the_ratio(two_rooms):
    few = score_topology(topology_of([(1, 1), (3, 1)], []), two_rooms)
    many = score_topology(topology_of([(1, 1), (3, 1), (1.2, 1), (3.2, 1)], []), two_rooms)
    assert 0.5 < few["nodes_vs_greedy"] <= 1
    assert many["nodes_vs_greedy"] == pytest.approx(2 * few["nodes_vs_greedy"])


def test_the_greedy_cover_is_of_the_ground_that_the_nodes_see(two_rooms):
    one_room = score_topology(topology_of([(1, 1)], []), two_rooms)
    assert one_room["nodes_vs_greedy"] == 1
    corner = score_topology(topology_of([(0.1, 0.1), (0.1, 0.2), (0.2, 0.1)], []), two_rooms)
    assert corner["nodes_vs_greedy"] >= 1.5


def test_an_edge_with_bends_is_followed_around_the_wall(two_rooms):
    topology = topology_of([(1, 0.5), (3, 0.5)], [(0, 1)])
    assert score_topology(topology, two_rooms)["edges_through_walls"] == 1
    topology.edge_path = lambda a, b: np.array([(1, 0.5, 0), (2.02, 1.7, 0), (3, 0.5, 0)])
    assert score_topology(topology, two_rooms)["edges_through_walls"] == 0


def test_ground_too_small_for_the_coarse_grid_is_covered_by_one_node():
    drivable = np.zeros((10, 10), np.bool_)
    drivable[5:8, 5:7] = True
    surface = GroundTruthSurface(
        Grid(np.zeros(2, np.int64), 0.05, drivable.shape), np.zeros(drivable.shape), drivable, ~drivable
    )
    assert score_topology(topology_of([(0.3, 0.3)], []), surface)["nodes_vs_greedy"] == 1
    assert score_topology(topology_of([], []), surface)["nodes_vs_greedy"] == 0


def test_the_greedy_cover_chooses_among_all_places():
    rng = np.random.default_rng(0)
    grid = Grid(np.zeros(2, np.int64), 0.05, (160, 120))
    walls = np.zeros(grid.shape, np.bool_)
    for i, j in rng.integers(0, 110, (25, 2)):
        walls[i, j : j + 30] = True
    truth = GroundTruthSurface(grid, np.zeros(grid.shape), ~walls, walls)
    positions = rng.uniform((0.5, 0.5), (4, 4), (12, 2))
    area = np.zeros(grid.shape, np.bool_)
    for window, corner in zip(
        *cells_in_sight(positions, ~walls, grid.origin, grid.cell, SIGHT_RANGE, ~walls), strict=True
    ):
        area[tuple((np.argwhere(window) + corner).T)] = True
    cells = np.argwhere(truth.drivable)
    places = grid.centre_of(cells[(cells % 4 == 0).all(axis=1)])
    seen, corners = cells_in_sight(places, area, grid.origin, grid.cell, SIGHT_RANGE, ~walls)
    missing, number = area.copy(), 0
    while (gain := count_in(seen, corners, missing)).max() * grid.cell**2 >= MIN_GAIN:
        best = gain.argmax()
        missing[tuple((np.argwhere(seen[best]) + corners[best]).T)] = False
        number += 1
    report = score_topology(topology_of(positions, []), truth)
    assert number > 5 and report["nodes_vs_greedy"] == len(positions) / number


def test_the_shortest_way_between_two_cells_is_that_of_a_graph():
    rng = np.random.default_rng(1)
    free = rng.random((30, 25)) > 0.25
    graph = nx.Graph()
    for i, j in np.argwhere(free):
        for a, b in ((i + 1, j), (i, j + 1), (i + 1, j + 1), (i + 1, j - 1)):
            if a < 30 and 0 <= b < 25 and free[a, b]:
                graph.add_edge((i, j), (a, b), weight=np.hypot(a - i, b - j))
    cells = sorted(graph)
    lengths = nx.single_source_dijkstra_path_length(graph, cells[0])
    for cell in cells[::29]:
        assert shortest_path_length(*cells[0], *cell, free) == pytest.approx(lengths.get(cell, np.inf))
