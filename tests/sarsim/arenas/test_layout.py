"""Plans of tiles that are made by hand."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sarsim.arenas.layout import BLOCKED, FLOOR, SIDES, Layout, TileGround, opposite
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.random_ground import choose_start, lay_ramps, make_maze

EAST, NORTH, WEST, SOUTH = SIDES


def test_an_edge_has_one_name_from_both_its_tiles():
    layout = Layout(3, 2)
    assert layout.edge((1, 0), WEST) == layout.edge((0, 0), EAST) == ((0, 0), EAST)
    assert layout.edge((1, 1), SOUTH) == ((1, 0), NORTH)
    assert len(layout.inner_edges()) == 2 * 2 + 3 * 1


def test_walls_stand_around_the_arena_and_where_they_are_put():
    layout = Layout(2, 1)
    assert layout.walls_of((0, 0)) == [NORTH, WEST, SOUTH]
    layout.walls.add(layout.edge((1, 0), WEST))
    assert layout.walls_of((0, 0)) == [EAST, NORTH, WEST, SOUTH]
    assert not layout.is_connected()


def test_a_ramp_is_entered_over_its_ends_alone_and_at_their_height():
    ramp = TileGround("ramp", 17, EAST)
    assert [ramp.level_at(side) for side in SIDES] == [17, None, 0, None]
    assert [TileGround("ridge", 17, NORTH).level_at(side) for side in SIDES] == [None, 0, None, 0]
    assert [TileGround("deck", 25).level_at(side) for side in SIDES] == [25] * 4
    assert [BLOCKED.level_at(side) for side in SIDES] == [None] * 4


def test_decks_are_reached_over_ramps_of_their_height():
    for level, expected in ((17, True), (25, False)):
        layout = Layout(3, 1)
        laid = layout.try_lay([((1, 0), TileGround("ramp", 17, EAST)), ((2, 0), TileGround("deck", level))])
        assert laid is expected
        assert (layout.ground((2, 0)) == FLOOR) is not expected


def test_what_would_cut_the_arena_in_two_is_not_done():
    layout = Layout(3, 1)
    assert not layout.try_block([(1, 0)])
    assert layout.try_block([(2, 0)])
    assert layout.ground((2, 0)) == BLOCKED
    assert layout.viewing_sides([(2, 0)]) == [((2, 0), WEST)]


def test_reserved_tiles_and_those_out_of_sight_are_not_blocked():
    layout = Layout(2, 2)
    layout.reserved.add((0, 0))
    assert not layout.try_block([(0, 0)])
    closed = Layout(2, 1)
    closed.walls.add(closed.edge((0, 0), EAST))
    assert not closed.try_block([(0, 0)])


@settings(max_examples=30)
@given(st.integers(3, 9), st.integers(3, 9), st.floats(0, 1), st.integers(0, 1000))
def test_mazes_with_ramps_hang_together_and_have_a_start_on_the_floor(columns, rows, density, seed):
    layout, draws = Layout(columns, rows), RandomDraws(np.random.default_rng(seed))
    make_maze(layout, draws, density)
    assert layout.is_connected()
    tile, _ = choose_start(layout, draws)
    lay_ramps(layout, draws, fraction=0.4, fields=True)
    assert layout.is_connected()
    assert layout.is_explorable()
    assert layout.ground(tile) == FLOOR
    assert tile in layout.reserved
    for t in layout.tiles():
        for s in layout.exits(t):
            assert opposite(s) in layout.exits(layout.next(t, s))


def test_before_a_ramp_two_tiles_in_a_line_are_needed():
    narrow = Layout(3, 1)
    narrow.start = (0, 0)
    assert not narrow.try_lay([((1, 0), TileGround("ridge", 17, EAST))])
    wide = Layout(4, 1)
    wide.start = (0, 0)
    assert wide.try_lay([((2, 0), TileGround("ridge", 17, EAST))])


def test_a_perfect_maze_has_one_way_between_any_two_tiles():
    layout = Layout(7, 6)
    make_maze(layout, RandomDraws(np.random.default_rng(0)), 1.0)
    open_edges = len(layout.inner_edges()) - len(layout.walls)
    assert open_edges == 7 * 6 - 1
    assert layout.is_connected()
