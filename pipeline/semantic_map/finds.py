"""Labels of finds in a map: signs and codes, people, and the boxes that hold people off the ground.

Signs lie flat on walls, and so do the backs of the boxes that hold the dolls of RoboCup Rescue, so their shape alone
does not distinguish them from the wall.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from pipeline.arrays import Indices, Labels, Mask, Points
from pipeline.geometry.parts import part_numbers
from pipeline.labels import Label


def with_finds(
    points: Points, labels: Labels, signs: Sequence[Points], people: Sequence[Points], step: float, skin: float
) -> Labels:
    """Labels of a map's points, changed so that signs and the boxes around people are clutter, and people victims.

    If any point is already labelled as a victim, all labels are kept.

    Args:
        points: points of the map.
        labels: labels of these points.
        signs: points of each sign or code.
        people: points of each person.
        step: minimum height of a hanging object above the points below it, m.
        skin: points within this distance of the points of a find belong to the find, m.
    """
    if (labels == Label.VICTIM).any():
        return labels
    result = labels.copy()
    for sign in signs:
        result[_near(points, sign, skin)] = Label.CLUTTER
    found = [_near(points, person, skin) for person in people]
    for person in found:
        result[person] = Label.VICTIM
    for person in found:
        result[_back_of_box(points, result, person, step, skin)] = Label.CLUTTER
    return result


def _near(points: Points, found: Points, skin: float) -> Indices:
    """Indices of the points within ``skin`` m of the points of a find."""
    if not len(found):
        return np.zeros(0, np.int64)
    around = _within(points, found, skin)
    distance, _ = KDTree(found).query(points[around], distance_upper_bound=skin)
    return around[np.isfinite(distance)]


def _within(points: Points, found: Points, skin: float) -> Indices:
    """Indices of the points in the bounding box of one or more ``found`` points, enlarged by ``skin`` m."""
    return _in_box(points, found.min(axis=0) - skin, found.max(axis=0) + skin)


def _in_box(points: Points, low: NDArray[np.float32], high: NDArray[np.float32]) -> Indices:
    """Indices of the points whose first D coordinates lie between the corners (D,), m."""
    own = points[:, : len(low)]
    return np.flatnonzero(((own >= low) & (own <= high)).all(axis=1))


def _back_of_box(points: Points, labels: Labels, person: Indices, step: float, skin: float) -> Indices:
    """Indices of the wall points in the convex hull of an object: a person and the clutter around the person.

    Empty unless the object hangs and is mostly clutter. On each side, a box extends beyond the visible part of the
    person in it by at most the length of this part.
    """
    nothing = np.zeros(0, np.int64)
    if not len(person):
        return nothing
    low, high = points[person].min(axis=0), points[person].max(axis=0)
    length = (high - low).max()
    around = _in_box(points, low - length, high + length)
    objects = around[np.isin(labels[around], (Label.VICTIM, Label.CLUTTER))]
    part_of = part_numbers(points[objects] - points[objects].min(axis=0), skin)
    own = objects[np.isin(part_of, part_of[np.isin(objects, person)])]
    if 2 * np.count_nonzero(labels[own] == Label.CLUTTER) <= len(own) or _is_standing(points, points[own], step):
        return nothing
    walls = _within(points, points[own], skin)
    walls = walls[labels[walls] == Label.WALL]
    return walls[_in_hull(points[walls], points[own], skin)]


def _in_hull(points: Points, own: Points, skin: float) -> Mask:
    """(N,) whether each point is in the convex hull of ``own`` or at most ``skin`` m outside each of its faces."""
    try:
        faces = ConvexHull(own).equations
    except QhullError:  # the points are coplanar, or too few
        return np.zeros(len(points), np.bool_)
    return (points @ faces[:, :3].T + faces[:, 3] <= skin).all(axis=1)


def _is_standing(points: Points, own: Points, step: float) -> bool:
    """Whether most points below an object are within ``step`` m of its bottom; True if no points are below it."""
    bottom = own[:, 2].min()
    heights = points[_in_box(points, own[:, :2].min(axis=0), own[:, :2].max(axis=0)), 2]
    below = heights[heights < bottom]
    return not len(below) or bool(np.median(below) > bottom - step)
