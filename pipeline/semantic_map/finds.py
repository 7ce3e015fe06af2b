"""What was found, in a labelled map: signs and codes, people, and the boxes that hold people off the ground.

Signs lie flat on walls, and so do the backs of the boxes in which the dolls of RoboCup Rescue lie: no shape tells
them from the wall.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull, KDTree, QhullError

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
    for found, label in ((things, Label.CLUTTER), (people, Label.VICTIM)):
        for of_it in found:
            result[_near(points, of_it)] = label
    for back in list(_hanging_boxes(points, result, step)):
        result[back] = Label.CLUTTER
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
    low, high = found.min(axis=0) - SKIN, found.max(axis=0) + SKIN
    return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))


def _hanging_boxes(points: NDArray[np.float32], labels: NDArray[np.uint8], step: float) -> Iterator[NDArray[np.intp]]:
    """Indices of what is taken for wall in the hull of each person who hangs and of the clutter around it.

    A box is larger than what is seen of the person in it.
    """
    is_person, is_clutter = labels == Label.VICTIM, labels == Label.CLUTTER
    if not is_person.any():
        return
    things = np.flatnonzero(is_person | is_clutter)
    part_of = _parts(points[things])
    for part in np.unique(part_of[is_person[things]]):
        own = things[part_of == part]
        if 2 * np.count_nonzero(is_clutter[own]) > len(own) and not _stands(points, points[own], step):
            walls = _within(points, points[own])
            walls = walls[labels[walls] == Label.WALL]
            yield walls[_in_hull(points[walls], points[own])]


def _in_hull(points: NDArray[np.float32], own: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(N,) which points (N, 3) are in the convex hull of others (M, 3), or up to SKIN from it."""
    try:
        faces = ConvexHull(own).equations
    except QhullError:  # they are flat, or too few
        return np.zeros(len(points), np.bool_)
    return (points @ faces[:, :3].T + faces[:, 3] <= SKIN).all(axis=1)


def _stands(points: NDArray[np.float32], own: NDArray[np.float32], step: float) -> bool:
    """Whether most of the points (N, 3) below a thing's (M, 3) reach up to it, to within ``step`` m."""
    (*low, bottom), (*high, _) = own.min(axis=0), own.max(axis=0)
    is_below = ((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1) & (points[:, 2] < bottom)
    return not is_below.any() or bool(np.median(points[is_below, 2]) > bottom - step)


def _parts(points: NDArray[np.float32]) -> NDArray[np.intp]:
    """(N,) number of the part of each point (N, 3); parts are apart by SKIN to twice as much."""
    cells = np.floor((points - points.min(axis=0)) / SKIN).astype(np.intp)
    grid = np.zeros(cells.max(axis=0) + 1, np.bool_)
    grid[tuple(cells.T)] = True
    parts, _ = ndimage.label(grid, np.ones((3, 3, 3)))
    return np.asarray(parts[tuple(cells.T)], np.intp)
