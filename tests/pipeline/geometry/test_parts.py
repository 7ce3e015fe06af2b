"""Connected parts of points: by hand, and against plain search."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components

from pipeline.geometry.parts import part_numbers


def test_points_in_neighbouring_cubes_are_of_one_part() -> None:
    points = np.array([(0.01, 0, 0), (0.11, -0.01, 0.01), (0.31, 0, 0), (0.41, 0.11, 0.11), (-0.01, 0, 0)])
    one, other = part_numbers(points, 0.1)[[0, 2]]
    assert one != other
    assert part_numbers(points, 0.1).tolist() == [one, one, other, other, one]


@given(st.integers(0, 2**32 - 1), st.integers(0, 60))
def test_parts_are_the_components_of_the_graph_of_neighbouring_cubes(seed: int, size: int) -> None:
    points = np.random.default_rng(seed).uniform(-2, 2, (size, 3))
    cubes = np.floor(points / 0.4)
    _, expected = connected_components(np.abs(cubes[:, None] - cubes).max(axis=2, initial=0) <= 1)
    found = part_numbers(points, 0.4)
    assert found.shape == (size,)
    assert ((found[:, None] == found) == (expected[:, None] == expected)).all()
    assert (found > 0).all()
