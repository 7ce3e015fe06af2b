"""Lines and segments: by hand, and against points sampled along the lines."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pipeline.segments.boxes import OrientedBox
from pipeline.segments.crossings import are_blocked, clip
from tests.pipeline.segments.patches import deck, segments_of, wall_patch

WALL = segments_of([wall_patch(0, 3)])
"""Along x from 0 to 3 m at y = 0, 1.2 m high."""
DOOR = segments_of([wall_patch(0, 1), wall_patch(1.8, 3), wall_patch(0, 3, z0=0.9, z1=1.2)])
"""The same wall with an opening from 1 to 1.8 m, 0.9 m high: one segment, whose box covers the opening."""


def crosses(segments, a, b, **options) -> bool:
    return bool(are_blocked(np.array([a], float), np.array([b], float), segments, **options)[0])


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ((1, -1, 0.3), (1, 1, 0.3), True),
        ((1, 1, 0.3), (1, -1, 0.3), True),
        ((0.5, -1, 0.3), (2.5, 1, 0.3), True),
        ((1, -1, 0.3), (1, -0.1, 0.3), False),
        ((1, 0.1, 0.3), (1, 1, 0.3), False),
        ((1, -1, 1.5), (1, 1, 1.5), False),
        ((-0.5, -1, 0.3), (-0.5, 1, 0.3), False),
        ((3.5, -1, 0.3), (3.5, 1, 0.3), False),
        ((-1, 0, 0.3), (4, 0, 0.3), True),
        ((-1, 0.1, 0.3), (4, 0.1, 0.3), False),
        ((1, 0, 0.3), (1, 0, 0.3), True),
        ((1, -1, 1.4), (1, 1, 0.6), True),
    ],
)
def test_wall(a, b, expected) -> None:
    assert crosses(WALL, a, b) is expected


def test_door_is_open_and_the_wall_beside_and_above_it_is_not() -> None:
    assert len(DOOR) == 1
    assert not crosses(DOOR, (1.4, -1, 0.3), (1.4, 1, 0.3))
    assert crosses(DOOR, (0.8, -1, 0.3), (0.8, 1, 0.3))
    assert crosses(DOOR, (1.4, -1, 1.0), (1.4, 1, 1.0))


def test_margin_widens_the_surface() -> None:
    assert not crosses(WALL, (3.3, -1, 0.3), (3.3, 1, 0.3), margin=0.2)
    assert crosses(WALL, (3.2, -1, 0.3), (3.2, 1, 0.3), margin=0.25)
    assert crosses(WALL, (1, -1, 0.3), (1, -0.2, 0.3), margin=0.25)
    assert not crosses(DOOR, (1.4, -1, 0.3), (1.4, 1, 0.3), margin=0.25)
    assert crosses(DOOR, (1.4, -1, 0.3), (1.4, 1, 0.3), margin=0.5)


def test_height_is_of_the_body_above_the_line() -> None:
    assert not crosses(DOOR, (1.4, -1, 0.05), (1.4, 1, 0.05), height=0.65)
    assert crosses(DOOR, (1.4, -1, 0.05), (1.4, 1, 0.05), height=1.0)
    hanging = segments_of([wall_patch(0, 3, z0=0.5, z1=1.2)])
    assert not crosses(hanging, (1, -1, 0.1), (1, 1, 0.1), height=0.3)
    assert crosses(hanging, (1, -1, 0.1), (1, 1, 0.1), height=0.5)


def test_deck_blocks_a_line_that_rises_through_it() -> None:
    segments = segments_of([deck(0, 1, 0, 1)])
    assert crosses(segments, (0.5, 0.5, 0), (0.5, 0.5, 1))
    assert not crosses(segments, (-1, 0.5, 0.05), (2, 0.5, 0.05))


def test_many_lines_and_segments_at_once() -> None:
    x = np.arange(-1, 5, 0.5)
    a, b = np.stack([x, x * 0 - 1, x * 0 + 0.3], 1), np.stack([x, x * 0 + 1, x * 0 + 0.3], 1)
    walls = segments_of([wall_patch(0, 1.2), wall_patch(2.8, 4.2)])
    expected = [crosses(walls, p, q) for p, q in zip(a, b, strict=True)]
    assert are_blocked(a, b, walls).tolist() == expected
    assert 0 < sum(expected) < len(x)


def test_no_segments_or_no_lines() -> None:
    assert not crosses([], (0, 0, 0), (1, 1, 1))
    assert are_blocked(np.empty((0, 3)), np.empty((0, 3)), WALL).shape == (0,)


coordinate = st.floats(-4, 4)
point = st.tuples(coordinate, coordinate, st.floats(-0.5, 1.5))


@given(point, point, st.floats(0, 0.3))
@example((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), 0.0)  # its end touches a corner of the box
def test_direction_does_not_matter(a, b, margin) -> None:
    assert crosses(DOOR, a, b, margin=margin) == crosses(DOOR, b, a, margin=margin)


@given(point, point, st.floats(0, 0.2), st.floats(0.01, 0.5))
def test_more_margin_or_height_blocks_no_less(a, b, margin, more) -> None:
    if crosses(DOOR, a, b, margin=margin):
        assert crosses(DOOR, a, b, margin=margin + more)
        assert crosses(DOOR, a, b, margin=margin, height=more)


@given(st.integers(0, 2**32 - 1))
def test_clip_agrees_with_points_along_the_line(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 3] = rng.normal(size=3)
    box = OrientedBox(T, rng.uniform(0.2, 2, 3))
    a, b = rng.normal(0, 2, (2, 20, 3))
    enter, leave = clip(a, b, [box], 0.1)
    t = np.linspace(0, 1, 2001)
    inside = np.abs((a[:, None] + t[:, None] * (b - a)[:, None] - T[:3, 3]) @ T[:3, :3]) <= box.extent / 2 + 0.1
    for n, along in enumerate(inside.all(axis=2)):
        assert not along.any() or t[along][[0, -1]] == pytest.approx([enter[n, 0], leave[n, 0]], abs=1e-3)
        assert along.any() or leave[n, 0] - enter[n, 0] < 1e-3
