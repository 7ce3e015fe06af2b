"""What was found, in a labelled map: signs and codes, people, and the boxes that hold people off the ground.

Signs lie flat on walls, and so do the backs of the boxes in which the dolls of RoboCup Rescue lie: no shape tells
them from the wall.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from pipeline.geometry.cells import parts
from pipeline.labels import Label

SKIN = 0.03  # m; a point this near to the points of what was found belongs to it


def with_finds(
    points: NDArray[np.float32],
    labels: NDArray[np.uint8],
    things: Sequence[NDArray[np.float32]],
    people: Sequence[NDArray[np.float32]],
    step: float,
) -> NDArray[np.uint8]:
    """(N,) labels of a map's points in which things are clutter and people victims, and boxes of people are whole.

    If some points are labelled as victim already, all keep their labels.

    Args:
        points: (N, 3) m.
        labels: (N,).
        things: (M, 3) points of each sign or code, m.
        people: (M, 3) points of each person, m.
        step: m; what is farther above the ground hangs.
    """
    if (labels == Label.VICTIM).any():
        return labels
    result = labels.copy()
    for thing in things:
        result[_near(points, thing)] = Label.CLUTTER
    found = [_near(points, person) for person in people]
    for person in found:
        result[person] = Label.VICTIM
    for person in found:
        result[_back_of_box(points, result, person, step)] = Label.CLUTTER
    return result


def _near(points: NDArray[np.float32], found: NDArray[np.float32]) -> NDArray[np.intp]:
    """Indices of the points (N, 3) within SKIN of those of a find (M, 3)."""
    if not len(found):
        return np.zeros(0, np.intp)
    around = _within(points, found)
    distance, _ = KDTree(found).query(points[around], distance_upper_bound=SKIN)
    return around[np.isfinite(distance)]


def _within(points: NDArray[np.float32], found: NDArray[np.float32]) -> NDArray[np.intp]:
    """Indices of the points (N, 3) in the bounding box of others (M, 3), at least one, or within SKIN of it."""
    return _in_box(points, found.min(axis=0) - SKIN, found.max(axis=0) + SKIN)


def _in_box(points: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.intp]:
    """Indices of the points (N, D) between corners (D,), of which only as many coordinates count."""
    own = points[:, : len(low)]
    return np.flatnonzero(((own >= low) & (own <= high)).all(axis=1))


def _back_of_box(
    points: NDArray[np.float32], labels: NDArray[np.uint8], person: NDArray[np.intp], step: float
) -> NDArray[np.intp]:
    """Indices of what is taken for wall in the hull of a person and of the clutter around it, if both hang.

    A box is larger than what is seen of the person in it, by no more than the person's length to each side.
    """
    nothing = np.zeros(0, np.intp)
    if not len(person):
        return nothing
    low, high = points[person].min(axis=0), points[person].max(axis=0)
    length = (high - low).max()
    around = _in_box(points, low - length, high + length)
    things = around[np.isin(labels[around], (Label.VICTIM, Label.CLUTTER))]
    part_of = parts(points[things] - points[things].min(axis=0), SKIN)
    own = things[np.isin(part_of, part_of[np.isin(things, person)])]
    if 2 * np.count_nonzero(labels[own] == Label.CLUTTER) <= len(own) or _stands(points, points[own], step):
        return nothing
    walls = _within(points, points[own])
    walls = walls[labels[walls] == Label.WALL]
    return walls[_in_hull(points[walls], points[own])]


def _in_hull(points: NDArray[np.float32], own: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(N,) which points (N, 3) are in the convex hull of others (M, 3), or up to SKIN from it."""
    try:
        faces = ConvexHull(own).equations
    except QhullError:  # they are flat, or too few
        return np.zeros(len(points), np.bool_)
    return (points @ faces[:, :3].T + faces[:, 3] <= SKIN).all(axis=1)


def _stands(points: NDArray[np.float32], own: NDArray[np.float32], step: float) -> bool:
    """Whether most of the points (N, 3) below a thing's (M, 3) reach up to it, to within ``step`` m."""
    bottom = own[:, 2].min()
    heights = points[_in_box(points, own[:, :2].min(axis=0), own[:, :2].max(axis=0)), 2]
    below = heights[heights < bottom]
    return not len(below) or bool(np.median(below) > bottom - step)
