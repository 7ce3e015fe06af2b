"""The loops that shorten detours."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.topological_map.topological_map import collision_free_tree, roadmap
from tests.pipeline.topological_map.grounds import room, topology_of


def test_a_square_is_closed_and_its_diagonals_are_not_worth_it():
    drives = nx.Graph()
    drives.add_weighted_edges_from([(0, 1, 1), (1, 2, 1), (2, 3, 1), (0, 3, 1), (0, 2, 1.9), (1, 3, 1.9)])
    tree = collision_free_tree(drives)
    assert roadmap(tree, drives, 1.1).number_of_edges() == 4
    assert roadmap(tree, drives, 1.0).number_of_edges() == 6
    assert roadmap(tree, drives, 9.0).number_of_edges() == 3


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 14), st.floats(1, 3))
def test_no_way_is_longer_than_the_greatest_detour(seed, size, max_detour):
    rng = np.random.default_rng(seed)
    drives = nx.gnp_random_graph(size, 0.5, seed=int(seed))
    for a, b in drives.edges:
        drives.edges[a, b]["weight"] = float(rng.uniform(1, 10))
    tree = collision_free_tree(drives)
    graph = roadmap(tree, drives, max_detour)
    assert set(map(frozenset, tree.edges)) <= set(map(frozenset, graph.edges))
    shortest, over = (dict(nx.all_pairs_dijkstra_path_length(g)) for g in (drives, graph))
    for a in drives:
        for b, least in shortest[a].items():
            assert over[a][b] <= max_detour * least + 1e-9


ISLAND = [((-1, -1), (1, -1)), ((1, -1), (1, 1)), ((1, 1), (-1, 1)), ((-1, 1), (-1, -1))]


@pytest.fixture(scope="module")
def around():
    return room((-2.3, 2.3), (-2.3, 2.3), ISLAND)


def test_the_way_around_an_island_is_closed(around):
    tree = topology_of(*around, (-1.7, 0), graph="mst")
    loop = topology_of(*around, (-1.7, 0), graph="roadmap")
    assert nx.is_tree(tree.graph)
    assert loop.nodes.keys() == tree.nodes.keys()
    assert len(nx.cycle_basis(loop.graph)) >= 1


def test_every_edge_is_a_drive_from_node_to_node(around):
    topology = topology_of(*around, (-1.7, 0))
    assert topology.graph.number_of_edges() >= 3
    for a, b, edge in topology.graph.edges(data=True):
        way = topology.edge_path(a, b)
        assert way[0].tolist() == topology.nodes[a].position.tolist()
        assert way[-1].tolist() == topology.nodes[b].position.tolist()
        assert topology.edge_path(b, a).tolist() == way[::-1].tolist()
        assert np.isfinite(around[0].line_seconds(way[:-1], way[1:])).all()
        assert edge["length"] == pytest.approx(np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1).sum())
