from itertools import combinations

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.topological_map.spanning_tree import collision_free_tree

CORNERS = {
    0: np.array([0.0, 0, 0]),
    1: np.array([1.0, 0, 0]),
    2: np.array([1.0, 1, 0]),
    3: np.array([0.0, 1.1, 0]),
}


def span(positions, is_free):
    return collision_free_tree(positions, combinations(positions, 2), is_free)


def test_edges_that_do_not_come_into_question_are_left_out():
    tree = collision_free_tree(CORNERS, [(0, 3), (1, 2)], lambda a, b: True)
    assert set(map(frozenset, tree.edges)) == {frozenset((0, 3)), frozenset((1, 2))}


def test_it_is_the_minimum_spanning_tree_where_all_is_free():
    tree = span(CORNERS, lambda a, b: True)
    assert set(map(frozenset, tree.edges)) == {frozenset(e) for e in ((0, 1), (1, 2), (2, 3))}
    assert tree.edges[0, 1]["weight"] == 1.0


def test_a_wall_turns_an_edge_away():
    tree = span(CORNERS, lambda a, b: {a, b} != {0, 1})
    assert set(map(frozenset, tree.edges)) == {frozenset(e) for e in ((0, 3), (1, 2), (2, 3))}


def test_what_walls_part_stays_apart():
    tree = span(CORNERS, lambda a, b: (a < 2) == (b < 2))
    assert sorted(map(sorted, nx.connected_components(tree))) == [[0, 1], [2, 3]]


def test_one_node_and_none():
    assert list(span({7: np.zeros(3)}, lambda a, b: True).nodes) == [7]
    assert len(span({}, lambda a, b: True)) == 0


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=2, max_size=12, unique=True),
    st.sets(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=40),
)
def test_it_agrees_with_the_tree_of_the_graph_without_blocked_edges(points, walls):
    positions = {n: np.array([*p, 0.0]) for n, p in enumerate(points)}

    def is_free(a, b):
        return (min(a, b), max(a, b)) not in walls

    tree = span(positions, is_free)
    graph = nx.Graph()
    graph.add_nodes_from(positions)
    for a in positions:
        for b in positions:
            if a < b and is_free(a, b):
                graph.add_edge(a, b, weight=float(np.linalg.norm(positions[a] - positions[b])))
    expected = nx.minimum_spanning_tree(graph)
    assert all(is_free(a, b) for a, b in tree.edges)
    assert nx.number_connected_components(tree) == nx.number_connected_components(graph)
    np.testing.assert_allclose(tree.size("weight"), expected.size("weight"))
