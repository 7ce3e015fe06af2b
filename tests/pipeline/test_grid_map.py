"""The grid that layers lie on."""

import numpy as np
from hypothesis import given
from hypothesis.extra import numpy as hnp

from pipeline.grid_map import Grid


@given(hnp.arrays(np.bool_, (4, 5)))
def test_the_distance_is_that_to_the_nearest_of_all_cells(mask):
    cells = np.argwhere(mask)
    expected = [
        [min((np.hypot(i - a, j - b) for a, b in cells), default=np.inf) for j in range(5)] for i in range(4)
    ]
    grid = Grid(np.zeros(2), 0.05, (4, 5))
    np.testing.assert_allclose(grid.distance_to(mask), 0.05 * np.array(expected))
