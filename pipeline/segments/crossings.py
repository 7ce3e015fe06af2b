"""Find the lines that pass through segments, such as edges that cross walls (thesis 3.3, figures 8 to 10)."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Mask, Places, Values
from pipeline.segments.boxes import OrientedBox
from pipeline.segments.segment import Segment

Clips: TypeAlias = NDArray[np.float64]
"""(N, S) line parameters t at which N lines enter or leave S boxes."""

_ROUNDING = 1e-9
"""Margin around boxes, m, so that rounding errors do not decide whether a line touches a box."""


def are_blocked(a: Places, b: Places, segments: Sequence[Segment], margin: float = 0.0, height: float = 0.0) -> Mask:
    """(N,) whether each of the straight lines from ``a`` to ``b`` passes through any of the segments.

    Each parametric line (thesis, equations 1 to 3) is clipped to each segment's box, which replaces the plane of
    equation 4. The part of the line inside the box must also come near a cell in which the surface was seen, because
    a line may pass through a doorway that the wall's box covers.

    Args:
        a, b: (N, 3) start and end points, m.
        segments: the segments that block lines, whatever their labels.
        margin: distance from a surface, m, within which a line is taken to pass through the surface.
        height: height of the body that moves along the line, measured upwards from the line, m.
    """
    result = np.zeros(len(a), np.bool_)
    near = _are_near_boxes(a, b, [segment.box for segment in segments], margin + _ROUNDING, height)
    rows = np.flatnonzero(near.any(axis=1))
    if len(rows):
        some = [segments[int(k)] for k in np.flatnonzero(near.any(axis=0))]
        result[rows] = _are_blocked(a[rows], b[rows], some, margin, height)
    return result


def _are_near_boxes(
    a: Places, b: Places, boxes: Sequence[OrientedBox], margin: float, height: float
) -> NDArray[np.bool_]:
    """(N, S) whether the axis-aligned bounding boxes of a body's path and of a segment's box overlap."""
    T = np.reshape([box.T_map_box for box in boxes], (-1, 4, 4))
    half = np.reshape([box.extent for box in boxes], (-1, 3)) / 2 + margin
    reach = np.einsum("sij,sj->si", np.abs(T[:, :3, :3]), half)
    low, high = np.minimum(a, b), np.maximum(a, b) + np.array([0, 0, height])
    above = (low[:, None] <= T[:, :3, 3] + reach).all(axis=2)
    return above & (high[:, None] >= T[:, :3, 3] - reach).all(axis=2)


def _are_blocked(a: Places, b: Places, segments: Sequence[Segment], margin: float, height: float) -> Mask:
    """The same as :func:`are_blocked`, for lines and segments that are near each other."""
    result = np.zeros(len(a), np.bool_)
    boxes, cell = [segment.box for segment in segments], segments[0].cell
    for lift in np.linspace(0, height, int(np.ceil(height / cell)) + 1):
        up = np.array([0, 0, lift])
        start, end = a + up, b + up
        enter, leave = clip(start, end, boxes, margin + _ROUNDING)
        for k in np.flatnonzero((enter <= leave).any(axis=0)):
            lines = np.flatnonzero((enter[:, k] <= leave[:, k]) & ~result)
            stretch = _sample(start[lines], end[lines], enter[lines, k], leave[lines, k], cell / 2)
            result[lines] = _are_near_surface(*stretch, len(lines), segments[int(k)], margin)
    return result


def clip(a: Places, b: Places, boxes: Sequence[OrientedBox], margin: float = 0.0) -> tuple[Clips, Clips]:
    """Clip N lines to S boxes that are ``margin`` m larger on every side.

    Returns:
        The t in [0, 1] at which x = a + (b - a) t enters each box, and the t at which x leaves the box. The former is
        greater if the line misses the box.
    """
    T = np.reshape([box.T_map_box for box in boxes], (-1, 4, 4))
    half = np.reshape([box.extent for box in boxes], (-1, 3)) / 2 + margin
    start = np.einsum("nsi,sij->nsj", a[:, None] - T[:, :3, 3], T[:, :3, :3])
    step = np.einsum("ni,sij->nsj", b - a, T[:, :3, :3])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        first, last = (-half - start) / step, (half - start) / step
    # A line parallel to a pair of faces lies entirely between them or entirely outside.
    along, between = step == 0, np.abs(start) <= half
    enter = np.where(along, np.where(between, -np.inf, np.inf), np.minimum(first, last))
    leave = np.where(along, np.inf, np.maximum(first, last))
    return np.maximum(enter.max(axis=2), 0), np.minimum(leave.min(axis=2), 1)


def _sample(a: Places, b: Places, enter: Values, leave: Values, step: float) -> tuple[Places, Indices]:
    """Points on each line from entry to exit, at most ``step`` m apart, and the index of each point's line."""
    counts = np.ceil((leave - enter) * np.linalg.norm(b - a, axis=1) / step).astype(int) + 1
    line = np.repeat(np.arange(len(a)), counts)
    share = np.concatenate([np.linspace(0, 1, count) for count in counts] or [np.empty(0)])
    t = enter[line] + share * (leave - enter)[line]
    return a[line] + t[:, None] * (b - a)[line], line


def _are_near_surface(points: Places, line: Indices, lines: int, segment: Segment, margin: float) -> Mask:
    """(lines,) bool, whether any point of each line is near a cell of the segment."""
    distance, _ = segment.tree.query(segment.plane.projected(points))
    half_diagonal = segment.cell * np.sqrt(3) / 2
    return np.bincount(line, distance <= margin + half_diagonal, lines) > 0
