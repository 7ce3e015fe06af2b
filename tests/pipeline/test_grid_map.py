"""The grid that layers lie on, and the map of layers that grows and reports what changed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.errors import InputError
from pipeline.grid_map import Grid, GridMap, LayerType

BLOCK, BORDER = 64, 20
"""Cells of the blocks in which a map grows, and beyond the points that it covers."""


@given(hnp.arrays(np.bool_, (4, 5)))
def test_the_distance_is_that_to_the_nearest_of_all_cells(mask):
    cells = np.argwhere(mask)
    expected = [[min((np.hypot(i - a, j - b) for a, b in cells), default=np.inf) for j in range(5)] for i in range(4)]
    grid = Grid(np.zeros(2, np.int64), 0.05, (4, 5))
    np.testing.assert_allclose(grid.distance_to(mask), 0.05 * np.array(expected))


def test_a_cell_lies_where_its_absolute_index_says():
    grid = Grid(np.array([-3, 7]), 0.5, (10, 10))
    np.testing.assert_allclose(grid.origin, (-1.5, 3.5))
    assert grid.cell_of([-1.2, 4.6]).tolist() == [0, 2]
    np.testing.assert_allclose(grid.centre_of([0, 2]), ((-3 + 0.5) * 0.5, (9 + 0.5) * 0.5))


def test_a_grid_holds_its_cells_and_no_others():
    grid = Grid(np.array([5, -9]), 0.05, (7, 3))
    cells = np.array([[(0, 0), (6, 2)], [(7, 0), (0, -1)]])
    assert grid.holds(cells).tolist() == [[True, True], [False, False]]


def test_a_part_of_a_grid_lies_where_its_cells_do():
    grid = Grid(np.array([-3, 7]), 0.5, (10, 10))
    part = grid.part((slice(2, 6), slice(1, 3)))
    assert part.low.tolist() == [-1, 8]
    assert part.shape == (4, 2)
    assert grid.box_of(part) == (slice(2, 6), slice(1, 3))
    assert grid.is_same(grid.part((slice(None), slice(None))))
    assert not grid.is_same(part)


LAYERS = {
    "height": LayerType(np.float32, np.nan),
    "seen": LayerType(np.bool_),
    "slope": LayerType(np.float32, per_cell=(2,)),
    "hits": LayerType(np.uint16, per_cell=(3,), in_place=True),
}


def test_it_does_not_grow_beyond_the_memory():
    grid_map = GridMap(0.05, LAYERS)
    grid_map.cover(np.zeros((1, 2)))
    before = grid_map.grid
    with pytest.raises(InputError, match=r"1.... × 1.... m .*GB"):
        grid_map.cover(np.array([(1e4, 1e4)]))
    assert grid_map.grid is before


def test_it_grows_in_blocks_around_points():
    grid_map = GridMap(0.05, LAYERS)
    block, border = 0.05 * BLOCK, 0.05 * BORDER
    grid_map.cover(np.array([(border, border), (block - border - 0.01, block)]))
    assert grid_map.grid.low.tolist() == [0, 0]
    assert grid_map.grid.shape == (BLOCK, 2 * BLOCK)
    grid_map.cover(np.array([(border - 0.01, 1.0)]))
    assert grid_map.grid.low.tolist() == [-BLOCK, 0]
    assert grid_map.grid.shape == (2 * BLOCK, 2 * BLOCK)
    assert grid_map["slope"].shape == (2 * BLOCK, 2 * BLOCK, 2)


def test_it_begins_where_the_points_are_however_far_away():
    grid_map = GridMap(0.05, LAYERS)
    grid_map.cover(np.array([(1000.0, -2000.0), (1001.0, -1999.0)]))
    assert max(grid_map.grid.shape) <= 2 * BLOCK
    assert grid_map.grid.mask_of(np.array([(1000.5, -1999.5)])).any()


def test_it_takes_the_extent_of_another_grid():
    grid_map, grid = GridMap(0.05, LAYERS), Grid(np.array([5, -9]), 0.05, (7, 3))
    grid_map.match(grid)
    assert grid_map.grid.is_same(grid)
    grid_map.match(Grid(np.array([6, -12]), 0.05, (2, 4)))
    assert grid_map.grid.is_same(Grid(np.array([5, -12]), 0.05, (7, 6)))


def test_only_what_differs_has_changed():
    grid_map = GridMap(0.05, LAYERS)
    grid_map.match(Grid(np.zeros(2, np.int64), 0.05, (4, 3)))
    grid_map.write("height", np.full((4, 3), np.nan))
    before = grid_map.revision
    grid_map.write("slope", (0.0, 1.0), (slice(1, 3), slice(0, 1)))
    grid_map.write("seen", True, (np.array([0, 3]), np.array([2, 2])))
    assert np.argwhere(grid_map.changed_since(before)).tolist() == [[0, 2], [1, 0], [2, 0], [3, 2]]
    assert np.argwhere(grid_map.changed_since(before, "slope")).tolist() == [[1, 0], [2, 0]]
    assert not grid_map.changed_since(before, "height").any()
    after = grid_map.revision
    grid_map.write("seen", True, (np.array([0, 3]), np.array([2, 2])))
    assert grid_map.revision == after
    assert not grid_map.changed_since(after).any()


def test_what_was_given_out_stays_as_it_was_and_what_is_changed_in_place_does_not():
    grid_map = GridMap(0.05, LAYERS)
    grid_map.match(Grid(np.zeros(2, np.int64), 0.05, (4, 3)))
    seen, hits = grid_map["seen"], grid_map["hits"]
    grid_map.write("seen", True)
    grid_map["hits"][1, 1] = 7
    assert not seen.any()
    assert (hits[1, 1] == 7).all()
    with pytest.raises(KeyError):
        grid_map.changed_since(0, "hits")


cells = st.tuples(st.integers(-12, 12), st.integers(-12, 12))
changes = st.lists(
    st.tuples(cells, st.integers(1, 6), st.integers(1, 6), st.sampled_from([0.0, 1.0, np.nan]), st.booleans()),
    min_size=1,
    max_size=8,
)


@settings(max_examples=60, deadline=None)
@given(changes, st.integers(0, 8))
def test_growth_keeps_values_and_changes_are_those_of_a_comparison(changes, since):
    """Compare with a large grid that does not grow, as a whole after every step."""
    low, grid_map = np.array([-12, -12]), GridMap(0.05, LAYERS)
    height, seen = np.full((32, 32), np.nan, np.float32), np.zeros((32, 32), np.bool_)
    changed, revision = np.zeros((32, 32), np.bool_), 0
    for n, ((i, j), di, dj, z, s) in enumerate(changes):
        if n == since:
            revision, changed[:] = grid_map.revision, False
        before = height.copy(), seen.copy()
        part = Grid(np.array([i, j]), 0.05, (di, dj))
        grid_map.match(part)
        grid_map.write("height", z, grid_map.grid.box_of(part))
        grid_map.write("seen", s, grid_map.grid.box_of(part))
        height[i + 12 : i + 12 + di, j + 12 : j + 12 + dj] = z
        seen[i + 12 : i + 12 + di, j + 12 : j + 12 + dj] = s
        changed |= (seen != before[1]) | ~np.isclose(height, before[0], equal_nan=True)
    whole = Grid(low, 0.05, (32, 32))
    box = whole.box_of(grid_map.grid)
    np.testing.assert_array_equal(grid_map["height"], height[box])
    np.testing.assert_array_equal(grid_map["seen"], seen[box])
    np.testing.assert_array_equal(grid_map.changed_since(revision, "height", "seen"), changed[box])
    assert changed.sum() == changed[box].sum()


def test_a_grid_around_places_holds_them_with_their_margin_and_the_grid_itself():
    grid = Grid(np.array([3, -7]), 0.05, (40, 30))
    places = np.array([(2.0, 1.0), (-1.0, 0.0)])
    around = grid.widened(places, 0.5)
    assert around.part(around.box_of(grid)).is_same(grid)
    corners = np.vstack([places - 0.5, places + 0.5])
    assert around.holds(around.cell_of(corners)).all()
    assert grid.widened(np.array([(0.5, 0.0)]), 0.0).is_same(grid)
