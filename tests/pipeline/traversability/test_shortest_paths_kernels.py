import numpy as np
import pytest

from pipeline.traversability.shortest_paths_kernels import ACROSS, Rules, shortest_paths

START, GOAL = (0, 0), (9, 4)
DIAGONAL = np.sqrt(2) * ACROSS


def hillside(slidable_rows):
    """10 x 5 cells that rise along i, all with room to drive across."""
    everywhere = np.ones((10, 5), np.bool_)
    slidable = np.zeros_like(everywhere)
    slidable[list(slidable_rows)] = True
    uphill = np.zeros((10, 5, 2), np.float32)
    uphill[..., 0] = 1
    return Rules(everywhere, everywhere, everywhere, slidable, uphill, np.cos(np.deg2rad(23)))


def search(slidable_rows, turn):
    """Cost of the way, and its cells."""
    cost, parent = shortest_paths(np.array([START]), np.ones((10, 5)), turn, hillside(slidable_rows))
    ends = cost[(slice(None), *GOAL)]
    state, cells = ends.argmin() * 50 + GOAL[0] * 5 + GOAL[1], []
    while state >= 0:
        cells.append(divmod(int(state) % 50, 5))
        state = parent[state]
    return ends.min(), cells[::-1]


def test_a_way_changes_from_along_the_slope_to_across_it_where_there_is_room_to_slide():
    cost, cells = search([5], turn=100)
    assert cost == pytest.approx(5 + 4 * DIAGONAL)
    assert cells == [(i, 0) for i in range(6)] + [(5 + k, k) for k in range(1, 5)]


def test_it_costs_nothing_to_change_where_there_is_room_everywhere():
    assert search(range(10), turn=100)[0] == pytest.approx(search([], turn=0)[0]) == pytest.approx(5 + 4 * DIAGONAL)


def test_without_room_to_slide_a_way_stays_across_or_pays_for_a_turn():
    assert search([], turn=100)[0] == pytest.approx(9 * DIAGONAL + ACROSS)
    assert search([], turn=1)[0] == pytest.approx(5 + 4 * DIAGONAL + 1)
