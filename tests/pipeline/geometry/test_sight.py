"""Which cells of a grid are seen from a cell."""

import numpy as np

from pipeline.geometry.sight import visible_cells

REACH = 70
"""Cells; so many that the tree of rays has more entries than 16 bits can number."""


def test_a_corridor_is_seen_up_to_the_reach_and_up_to_a_wall() -> None:
    target, walls = np.ones((100, 1), np.bool_), np.zeros((100, 1), np.bool_)
    (seen,) = visible_cells(np.array([[0, 0]]), target, walls, REACH)
    assert np.argwhere(seen).tolist() == [[REACH + i, REACH] for i in range(REACH + 1)]
    walls[50] = True
    (seen,) = visible_cells(np.array([[0, 0]]), target, walls, REACH)
    assert np.argwhere(seen).tolist() == [[REACH + i, REACH] for i in range(50)]
