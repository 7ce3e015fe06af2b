"""Sets of cells: by hand, and in any order."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.geometry import cells as module
from pipeline.geometry.cells import NONE, centres, connected_pieces, in_contact, unite
from pipeline.geometry.cells_kernels import placed_cells
from pipeline.geometry.moving_kernels import moved
from pipeline.transforms import from_yaw

EDGE = 0.05


def cells_of(points):
    return module.cells_of(points, EDGE)


def sheet(x0, x1, y0, y1, z=0.0, spacing=0.01):
    x, y = np.arange(x0, x1, spacing) + spacing / 2, np.arange(y0, y1, spacing) + spacing / 2
    return np.stack([*(g.ravel() for g in np.meshgrid(x, y)), np.full(len(x) * len(y), z)], 1).astype(np.float32)


def pieces(*sheets):
    """Number of pieces, and the piece of every sheet's middle."""
    cells, row = cells_of(np.vstack(sheets))
    piece = connected_pieces(cells, np.bincount(row))
    starts = np.cumsum([0, *map(len, sheets)])
    middles = [s + np.abs(p - p.mean(axis=0)).sum(axis=1).argmin() for s, p in zip(starts, sheets, strict=False)]
    return len(set(piece) - {NONE}), piece[row[middles]]


def test_cells_hold_their_points() -> None:
    points = np.random.default_rng(0).uniform(-2, 2, (1000, 3)).astype(np.float32)
    cells, row = cells_of(points)
    assert np.abs(centres(cells, EDGE)[row] - points).max() <= EDGE / 2 + 1e-6
    assert len(np.unique(cells, axis=0)) == len(cells)


def test_placed_cells_hold_the_moved_points() -> None:
    points, T = np.random.default_rng(0).uniform(-2, 2, (1000, 3)).astype(np.float32), from_yaw(3, -7, 0.3, 2.1)
    assert np.array_equal(placed_cells(T, points, EDGE), cells_of(moved(T, points))[0])


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_contact_takes_ten_cells_with_another_cell_near(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (np.unique(rng.integers(-4, 8, (n, 3)).astype(np.int32), axis=0) for n in (size, 60))
    near = (np.abs(a[:, None] - b).max(axis=2) <= 2).any(axis=1).sum()
    assert in_contact(a, b) == (near >= 10)


def test_floor_at_zero_lies_in_one_layer_whatever_the_noise() -> None:
    assert len(cells_of(sheet(0, 1, 0, 1, z=0.01))[0]) == len(cells_of(sheet(0, 1, 0, 1, z=-0.01))[0])
    assert set(cells_of(np.vstack([sheet(0, 1, 0, 1, z=z) for z in (0.01, 0, -0.01)]))[0][:, 2]) == {0}


@given(st.lists(st.integers(0, 2**32 - 1), min_size=2, max_size=5), st.randoms(use_true_random=False))
def test_union_does_not_depend_on_the_order(seeds, random) -> None:
    sets = [cells_of(np.random.default_rng(s).uniform(-1, 1, (20, 3)).astype(np.float32))[0] for s in seeds]
    forward = sets[0]
    for other in sets[1:]:
        forward = unite(forward, other)
    random.shuffle(sets)
    shuffled = sets[0]
    for other in sets[1:]:
        shuffled = unite(shuffled, other)
    assert np.array_equal(forward, shuffled)
    assert len(forward) == len(np.unique(np.vstack(sets), axis=0))


@pytest.mark.parametrize(("gap", "parts"), [(0.0, 1), (0.04, 1), (0.16, 2), (0.4, 2)])
def test_gap_parts_a_surface(gap: float, parts: int) -> None:
    left, right = sheet(0, 1, 0, 1), sheet(1 + gap, 2, 0, 1)
    assert pieces(left, right)[0] == parts
    assert in_contact(cells_of(left)[0], cells_of(right)[0]) == (parts == 1)


@pytest.mark.parametrize("shift", np.arange(0, EDGE, 0.01))
def test_surfaces_whose_corners_touch_are_two(shift: float) -> None:
    one, other = sheet(0, 1, 0, 1) + np.float32(shift), sheet(1, 2, 1, 2) + np.float32(shift)
    count, (a, b) = pieces(one, other)
    assert count == 2
    assert a != b
    assert not in_contact(cells_of(one)[0], cells_of(other)[0])


def test_narrow_strip_is_one_piece() -> None:
    assert pieces(sheet(0, 1, 0, 0.04))[0] == 1


def test_rooms_joined_by_a_thin_strip_are_two_and_share_it() -> None:
    count, (one, other, _) = pieces(sheet(0, 1, 0, 1), sheet(1.5, 2.5, 0, 1), sheet(1, 1.5, 0.5, 0.55))
    assert count == 2
    assert one != other


def test_stray_points_at_an_edge_are_no_part_of_the_surface() -> None:
    surface = sheet(0, 1, 0, 1)
    cells, row = cells_of(np.vstack([surface, [(1.06, 0.5, 0), (1.06, 0.51, 0)]]))
    piece = connected_pieces(cells, np.bincount(row))
    assert (piece[row[-2:]] == NONE).all()
    # Of the surface itself, at most corner cells are noise, of which it fills little.
    assert np.count_nonzero(piece == NONE) <= 5


def test_far_sets_are_not_in_contact() -> None:
    assert not in_contact(cells_of(sheet(0, 1, 0, 1))[0], cells_of(sheet(8, 9, 0, 1))[0])
