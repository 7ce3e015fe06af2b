"""Which lines pass through which segments: the test for edges that cross walls (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.semantic_map.boxes import Box
from pipeline.semantic_map.cells import CELL
from pipeline.semantic_map.segments import Segment

_SPACING = CELL / 2
"""m, at most, between the places on a line where it is held against a surface."""
_HALF_DIAGONAL = CELL * np.sqrt(3) / 2


def crossings(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    segments: Sequence[Segment],
    margin: float = 0.0,
    height: float = 0.0,
) -> NDArray[np.bool_]:
    """Which of the straight lines from ``a`` to ``b`` pass through one of the segments.

    The parametric line (thesis, equations 1 to 3) is clipped to the segment's box, which takes the place of the
    plane of equation 4. What is inside must also come near a cell in which the surface was seen: a door in a wall
    is open although the wall's box is not.

    Args:
        a: (N, 3) m in ``map``.
        b: (N, 3) m in ``map``.
        segments: those that block, of whatever label.
        margin: m; a line that comes this near to a surface passes through it.
        height: m, of the body that moves along the line: it reaches from the line up to so far above it.
    """
    result = np.zeros(len(a), np.bool_)
    for lift in np.linspace(0, height, int(np.ceil(height / CELL)) + 1):
        up = np.array([0, 0, lift])
        for segment in segments:
            result |= _cross(a + up, b + up, segment, margin)
    return result


def _cross(
    a: NDArray[np.float64], b: NDArray[np.float64], segment: Segment, margin: float
) -> NDArray[np.bool_]:
    """(N,) bool, the lines through one segment."""
    enter, leave = clip(a, b, segment.box, margin)
    result = enter <= leave
    inside = np.flatnonzero(result)
    if len(inside):
        points, line = _sample(a[inside], b[inside], enter[inside], leave[inside])
        points -= segment.plane.distance(points)[:, None] * segment.plane.normal
        near = segment.tree.query(points)[0] <= margin + _HALF_DIAGONAL
        result[inside] = np.bincount(line, near, len(inside)) > 0
    return result


def clip(
    a: NDArray[np.float64], b: NDArray[np.float64], box: Box, margin: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where lines are inside a box that is ``margin`` m larger on every side.

    Returns:
        (N,) and (N,) the t in [0, 1] at which x = a + (b - a) t enters and leaves; enter > leave where it never does.
    """
    R, centre = box.T_map_box[:3, :3], box.T_map_box[:3, 3]
    start, step = (a - centre) @ R, (b - a) @ R
    half = box.extent / 2 + margin
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = (-half - start) / step, (half - start) / step
    # A line along a pair of faces is between them always or never.
    along = step == 0
    between = np.abs(start) <= half
    first, last = (
        np.where(along, np.where(between, -np.inf, np.inf), np.minimum(first, last)),
        np.where(along, np.inf, np.maximum(first, last)),
    )
    return np.maximum(first.max(axis=1), 0), np.minimum(last.min(axis=1), 1)


def _sample(
    a: NDArray[np.float64], b: NDArray[np.float64], enter: NDArray[np.float64], leave: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """(M, 3) points close together from where each line enters to where it leaves, and their (M,) lines."""
    counts = np.ceil((leave - enter) * np.linalg.norm(b - a, axis=1) / _SPACING).astype(int) + 1
    line = np.repeat(np.arange(len(a)), counts)
    share = np.concatenate([np.linspace(0, 1, count) for count in counts])
    t = enter[line] + share * (leave - enter)[line]
    return a[line] + t[:, None] * (b - a)[line], line
