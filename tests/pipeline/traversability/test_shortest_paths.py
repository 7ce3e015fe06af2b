import networkx as nx
import numpy as np
import pytest

from pipeline.traversability.shortest_paths import RAMP_COST, ShortestPaths, may_cut, simplify
from pipeline.traversability.traversability import assess_map
from tests.pipeline.worlds import flat, ground_points, ramp_and_deck, ridge, surface_of, wall_points


@pytest.fixture(scope="module")
def maze():
    """A wall from the south edge up to y = 0.6 between two halves of a square."""
    return assess_map(surface_of(ground_points(flat, (-2, 2), (-2, 2)), wall_points((0, -2), (0, 0.6))))


def test_it_agrees_with_networkx(maze):
    paths = ShortestPaths(maze, (-1.0, -1.0))
    weight = np.where(maze.turnable, 1.0, 1.5)
    graph = nx.Graph()
    cells = set(map(tuple, np.argwhere(maze.traversable).tolist()))
    for i, j in cells:
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            if (i + di, j + dj) in cells:
                mean = (weight[i, j] + weight[i + di, j + dj]) / 2
                graph.add_edge((i, j), (i + di, j + dj), weight=np.hypot(di, dj) * mean)
    start = tuple(maze.grid.cell_of(paths.start).tolist())
    expected = nx.single_source_dijkstra_path_length(graph, start)
    for cell, cost in expected.items():
        assert paths.cost[cell] == pytest.approx(cost * maze.grid.cell, rel=1e-4, abs=1e-5)
    assert paths.reachable.sum() == len(expected)


def test_paths_go_around_walls(maze):
    paths = ShortestPaths(maze, (-1.0, -1.0))
    path = paths.path_to((1.0, -1.0))
    assert maze.grid.at(maze.traversable, path).all()
    assert path[:, 1].max() > 0.85
    np.testing.assert_allclose(path[[0, -1]], [(-1, -1), (1, -1)], atol=0.05)


def test_simplified_paths_are_few_drivable_lines(maze):
    path = ShortestPaths(maze, (-1.0, -1.0)).path_to((1.0, -1.0))
    bends = simplify(maze, path)
    assert 3 <= len(bends) <= 6
    assert maze.lines_are_traversable(bends[:-1], bends[1:]).all()
    assert maze.grid.at(maze.turnable, bends[1:-1]).all()
    np.testing.assert_array_equal(bends[[0, -1]], path[[0, -1]])


def test_no_short_cut_passes_a_corner_closer_than_the_way_does(maze):
    line = np.array([(-1.5, 0.92), (1.5, 0.92)])  # 0.33 m beside the end of the wall
    assert maze.lines_are_traversable(line[:1], line[1:])[0]
    around = np.vstack([line[0], (0.0, 1.2), line[1]])
    assert may_cut(maze, line)[-1]
    assert not may_cut(maze, around)[-1]


def test_ramps_cost_more_and_are_met_head_on():
    traversability = assess_map(surface_of(ground_points(ridge, (-2, 2), (-1, 1))))
    paths = ShortestPaths(traversability, (-1.5, 0.0))
    assert paths.cost_to((1.5, 0.0)) > 3.0 + (RAMP_COST - 1) * 1.0
    path = paths.path_to((1.5, 0.4))
    on_ramp = traversability.grid.at(traversability.ramp, path)
    assert np.ptp(path[on_ramp, 1]) < 1e-9


def test_the_deck_is_reached_over_its_ramp_only():
    traversability = assess_map(surface_of(ground_points(ramp_and_deck, (-2, 2), (-2, 2))))
    path = ShortestPaths(traversability, (1.2, 1.2)).path_to((1.2, 0.0))
    assert path[:, 0].min() < -0.1


def test_of_several_starts_the_nearest_counts(maze):
    both = ShortestPaths(maze, [(-1.0, -1.0), (1.0, -1.0)])
    alone = [ShortestPaths(maze, start) for start in ((-1.0, -1.0), (1.0, -1.0))]
    np.testing.assert_allclose(both.cost, np.minimum(*(paths.cost for paths in alone)), rtol=1e-5)
    np.testing.assert_allclose(both.path_to((0.6, -0.6))[0], (1, -1), atol=0.05)


def test_arrival_is_the_direction_of_the_end_of_the_path(maze):
    paths = ShortestPaths(maze, (-1.0, -1.0))
    ends = np.array([(-1.0, 1.0), (-1.5, -1.0), (-0.5, -0.5)])
    for end, heading in zip(ends, paths.arrival_at(ends), strict=True):
        path = paths.path_to(end)
        way = path[-1] - path[-7]
        assert heading == pytest.approx(np.arctan2(way[1], way[0]))


def test_paths_pass_by_what_lies_on_them(maze):
    paths = ShortestPaths(maze, (-1.0, -1.0))
    targets = np.array([(1.0, -1.0), (-1.0, 1.0), (0.0, 1.5)])
    x = maze.grid.centre_of(np.moveaxis(np.indices(maze.grid.shape), 0, -1))[..., 0]
    assert paths.pass_by(x > 0.1, targets).tolist() == [True, False, False]
    on_way = np.zeros(maze.grid.shape, np.bool_)
    on_way[tuple(maze.grid.cell_of(paths.path_to(targets[0])).T)] = True
    assert paths.pass_by(on_way, targets).all()  # they begin at the same place


def test_no_start_and_no_way():
    traversability = assess_map(surface_of(ground_points(flat, (0, 2), (0, 2))))
    nowhere = ShortestPaths(traversability, (9.0, 9.0))
    assert nowhere.start is None
    assert not nowhere.reachable.any()
    assert ShortestPaths(traversability, (1.0, 1.0)).cost_to((9.0, 9.0)) == np.inf
