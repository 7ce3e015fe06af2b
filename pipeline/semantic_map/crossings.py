"""Which lines pass through which segments: the test for edges that cross walls (thesis 3.3, figures 8 to 10)."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pipeline.semantic_map.boxes import Box
from pipeline.semantic_map.cells import CELL
from pipeline.semantic_map.segments import Segment

_SAMPLE = CELL / 2
_HALF_DIAGONAL = CELL * np.sqrt(3) / 2


def crossings(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    segments: Iterable[Segment],
    margin: float = 0.0,
    height: float = 0.0,
) -> NDArray[np.bool_]:
    """Which of the straight lines from ``a`` to ``b`` pass through one of the segments.

    The parametric line (thesis, equations 1 to 3) is clipped to the segment's box; of what lies inside, some part must
    come near a cell in which the surface was seen, so that a door in a wall is open although the wall's box is not.

    Args:
        a: (N, 3) m in ``map``.
        b: (N, 3) m in ``map``.
        segments: of any label.
        margin: m, how near to the surface is through it.
        height: m, of the body that moves along the line: it counts from the line up to so far above it.
    """
    a, b = np.atleast_2d(a), np.atleast_2d(b)
    lifts = np.linspace(0, height, int(np.ceil(height / CELL)) + 1)
    result = np.zeros(len(a), bool)
    for segment in segments:
        for lift in lifts:
            open_lines = np.flatnonzero(~result)
            up = np.array([0, 0, lift])
            result[open_lines] = _cross(a[open_lines] + up, b[open_lines] + up, segment, margin)
    return result


def _cross(a: NDArray, b: NDArray, segment: Segment, margin: float) -> NDArray[np.bool_]:
    """(N,) bool, the lines through one segment."""
    enter, leave = clip(a, b, segment.box, margin)
    result = enter <= leave
    through = np.flatnonzero(result)
    if not len(through):
        return result
    points, line = _samples(a[through], b[through], enter[through], leave[through])
    points -= segment.plane.distance(points)[:, None] * segment.plane.normal
    distance, _ = segment.tree.query(points)
    result[through] = np.bincount(line, distance <= margin + _HALF_DIAGONAL, len(through)) > 0
    return result


def clip(
    a: NDArray[np.float64], b: NDArray[np.float64], box: Box, margin: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where lines are inside a box that is ``margin`` m larger on every side.

    Returns:
        (N,) and (N,) parameters t of x = a + (b - a) t on entering and leaving, in [0, 1]; enter > leave: never.
    """
    T = box.T_map_box
    start = (a - T[:3, 3]) @ T[:3, :3]
    step = (b - a) @ T[:3, :3]
    half = box.extent / 2 + margin
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.stack([(-half - start) / step, (half - start) / step])
    # Along a face the line is between the two planes for ever or never.
    parallel = step == 0
    t[0][parallel] = np.where(np.abs(start) <= half, -np.inf, np.inf)[parallel]
    t[1][parallel] = np.inf
    t.sort(axis=0)
    return np.maximum(t[0].max(axis=1), 0), np.minimum(t[1].min(axis=1), 1)


def _samples(
    a: NDArray, b: NDArray, enter: NDArray, leave: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Points at most ``_SAMPLE`` apart on the stretches between ``enter`` and ``leave``, and their lines."""
    lengths = (leave - enter) * np.linalg.norm(b - a, axis=1)
    counts = np.ceil(lengths / _SAMPLE).astype(int) + 1
    line = np.repeat(np.arange(len(a)), counts)
    order = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = order / np.maximum(counts[line] - 1, 1)
    t = enter[line] + share * (leave - enter)[line]
    return a[line] + t[:, None] * (b - a)[line], line
