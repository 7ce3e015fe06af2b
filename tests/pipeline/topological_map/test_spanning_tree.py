"""The tree by hand, and against the thesis's own procedure."""

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.topological_map.topological_map import collision_free_tree

HUGE = 1e6


def complete_graph(points) -> nx.Graph:
    graph = nx.complete_graph(len(points))
    for a, b in graph.edges:
        graph.edges[a, b]["weight"] = float(np.linalg.norm(np.subtract(points[a], points[b])))
    return graph


def free_graph(points, walls) -> nx.Graph:
    graph = complete_graph(points)
    graph.remove_edges_from(walls)
    return graph


def tree_by_raised_weights(points, walls) -> nx.Graph:
    """The loop as the thesis describes it."""
    graph = complete_graph(points)
    while True:
        tree = nx.minimum_spanning_tree(graph)
        blocked = [(a, b) for a, b, w in tree.edges(data="weight") if w < HUGE and (a, b) in walls]
        if not blocked:
            tree.remove_edges_from([(a, b) for a, b, w in tree.edges(data="weight") if w >= HUGE])
            return tree
        for a, b in blocked:
            graph.edges[a, b]["weight"] += HUGE


CORNERS = [(0, 0), (1, 0), (1, 1), (0, 1.1)]


def edges_of(tree) -> set[frozenset[int]]:
    return set(map(frozenset, tree.edges))


def test_it_is_the_minimum_spanning_tree_where_all_is_free():
    tree = collision_free_tree(free_graph(CORNERS, []))
    assert edges_of(tree) == {frozenset(e) for e in ((0, 1), (1, 2), (2, 3))}
    assert tree.edges[0, 1]["weight"] == 1.0


def test_a_wall_turns_an_edge_away():
    tree = collision_free_tree(free_graph(CORNERS, [(0, 1)]))
    assert edges_of(tree) == {frozenset(e) for e in ((0, 3), (1, 2), (2, 3))}


def test_what_walls_part_stays_apart():
    tree = collision_free_tree(free_graph(CORNERS, [(0, 2), (0, 3), (1, 2), (1, 3)]))
    assert sorted(map(sorted, nx.connected_components(tree))) == [[0, 1], [2, 3]]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99)), min_size=1, max_size=12, unique=True),
    st.sets(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=40),
)
def test_it_agrees_with_raising_weights_until_nothing_collides(points, pairs):
    walls = {(a, b) for a, b in pairs if a < b < len(points)}
    tree, expected = collision_free_tree(free_graph(points, walls)), tree_by_raised_weights(points, walls)
    assert not walls & set(tree.edges)
    assert sorted(map(sorted, nx.connected_components(tree))) == sorted(
        map(sorted, nx.connected_components(expected))
    )
    np.testing.assert_allclose(tree.size("weight"), expected.size("weight"))
