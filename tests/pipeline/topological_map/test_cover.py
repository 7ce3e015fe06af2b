"""The cells that nodes see, compared with a line drawn to every cell."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.geometry.sight import visible_cells
from pipeline.geometry.sight_kernels import line_is_free
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.cover import NodeCover
from tests.pipeline.topological_map.grounds import U_TURN, room

REACH = 12
CONFIG = TopologicalMapConfig(sight=2.0)


def seen_by_lines(place, walls, reach):
    cells = np.argwhere(np.ones_like(walls))
    ends = cells + 0.5
    clear = np.array([line_is_free(*place, *end, np.zeros(2), 1.0, ~walls) for end in ends])
    near = np.linalg.norm(ends - place, axis=1) <= reach
    return (clear & near).reshape(walls.shape)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_place_sees_what_lines_reach(seed):
    rng = np.random.default_rng(seed)
    walls = np.zeros((40, 30), np.bool_)
    for _ in range(4):
        i, j = rng.integers(0, 40), rng.integers(0, 30)
        walls[i : i + rng.integers(1, 12), j : j + 1] = True
    cell = rng.integers((0, 0), (40, 30))
    walls[tuple(cell)] = False
    seen = visible_cells(cell[None], np.ones_like(walls), walls, REACH)
    mask = np.zeros((40 + 2 * REACH + 2, 30 + 2 * REACH + 2), np.bool_)
    i, j = cell
    mask[i : i + 2 * REACH + 1, j : j + 2 * REACH + 1] = seen[0]
    viewpoint = mask[REACH : REACH + 40, REACH : REACH + 30]
    expected = seen_by_lines(cell + 0.5, walls, REACH)
    assert not viewpoint[walls].any()
    # A ray to the rim and a line to the cell's centre may pass a corner on different sides.
    assert (viewpoint != expected).sum() <= 0.25 * expected.sum() + 12


def update(cover, traversability, segments):
    return cover.update(traversability, traversability.traversable, list(segments))


@pytest.fixture
def cover():
    cover = NodeCover(CONFIG)
    assert update(cover, *room((-3, 3), (-2, 2), U_TURN)).any()
    return cover


def test_a_wall_hides_and_distance_too(cover):
    cover.add(0, np.array([-0.975, -0.975]))
    x, y = np.moveaxis(cover.grid.centre_of(np.argwhere(cover.missing)), -1, 0)
    assert not ((x < -0.4) & (np.hypot(x + 1, y + 1) < 1.9)).any()
    cells = cover.grid.centre_of(np.argwhere(cover.view_counts > 0))
    assert not (cells[:, 0] > 0.1).any()
    assert np.linalg.norm(cells - (-0.975, -0.975), axis=1).max() <= 2.001


def test_gains_and_losses_are_the_change_in_what_is_missing(cover):
    cover.add(0, np.array([-1.0, 0.0]))
    before = cover.missing.sum()
    visible = cover.visible_from(np.array([(1.0, 0.0), (-1.2, 0.3)]))
    gains = cover.gains(visible)
    cover.add(1, visible.places[0])
    assert before - cover.missing.sum() == gains[0] > gains[1]
    lost = cover.lost_without([1])
    assert len(lost) == gains[0]
    assert cover.see_all(visible, lost, 0).tolist() == [True, False]
    cover.remove(1)
    assert cover.missing.sum() == before


def test_what_is_renewed_is_what_is_made_anew(cover):
    places = [(-1.0, 0.0), (1.0, 1.0), (2.4, -1.4)]
    for n, place in enumerate(places):
        cover.add(n, np.array(place))
    grown, anew, shape = (
        room((-3, 7), (-5, 9), [*U_TURN, ((1.5, -2), (1.5, 0))]),
        NodeCover(CONFIG),
        cover.grid.shape,
    )
    update(cover, *grown)
    assert cover.grid.shape != shape
    update(anew, *grown)
    for n, place in enumerate(places):
        anew.add(n, np.array(place))
    np.testing.assert_array_equal(cover.view_counts, anew.view_counts)


def test_only_what_is_new_has_changed(cover):
    assert not update(cover, *room((-3, 3), (-2, 2), U_TURN)).any()
    changed = update(cover, *room((-3, 3), (-2, 2), [*U_TURN, ((1.5, -2), (1.5, -1))]))
    x, y = np.moveaxis(cover.grid.centre_of(np.argwhere(changed)), -1, 0)
    assert len(x) > 0
    assert x.min() > 1.0
    assert y.max() < -0.5


def test_candidates_stand_where_the_robot_can_turn_and_near_the_mask(cover):
    mask = np.zeros(cover.grid.shape, np.bool_)
    mask[tuple(cover.grid.cell_of((2.0, 1.0)))] = True
    places = cover.candidates(mask, 0.8)
    assert len(places) > 20
    assert cover.grid.at(cover.standable, places).all()
    assert np.linalg.norm(places - (2.0, 1.0), axis=1).max() < 0.85
    assert len(cover.candidates(mask, 0.8, min_cells=2)) == 0
    assert len(cover.candidates(np.zeros_like(mask), 0.8)) == 0
