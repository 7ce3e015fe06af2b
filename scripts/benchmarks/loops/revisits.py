"""Find the frames of a tour that revisit places, from the ground truth."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.arrays import Indices, Values
from pipeline.localisation.config import RegistrationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.transforms import transform_places
from scripts.benchmarks.localisation_scores import distances_driven
from scripts.benchmarks.loops.tours import Tour

MIN_REVISIT_PATH = 20.0  # m, minimum length of the path between two passes
SAME_SURFACE = 0.05  # m, maximum distance between points on the same surface
MIN_SEEN = 0.4  # Minimum fraction of a frame's points that were seen in earlier passes
MIN_INFORMATION = 0.005
"""Minimum eigenvalue, per point, of the information on heading, x and y in the normals of the points seen again.

The eigenvalue is 0 along a corridor and 0.3 in a square room; ``LEVER`` relates the heading to x and y.
"""
LEVER = 2.0  # m, length that converts the heading to a distance
SPLIT_DISTANCE = 3.0  # m, length of path without revisiting frames that separates two revisits


def revisits(tour: Tour) -> list[Indices]:
    """The stretches of a tour that revisit places, each as the indices of its frames."""
    way, shown = distances_driven(tour.true), np.zeros(len(tour.times), np.bool_)
    clouds, trees = list[NDArray[np.float64]](), list[cKDTree]()
    for n, frame in enumerate(tour.frames()):
        cloud = cloud_of_frame(frame, RegistrationConfig())
        points = np.zeros((0, 3)) if cloud is None else transform_places(tour.true[n], cloud.points()[:, :3])
        clouds.append(points)
        trees.append(cKDTree(points))
        if cloud is not None:
            normals = cloud.normals()[:, :3] @ tour.true[n, :3, :3].T
            shown[n] = _is_seen_again(points, normals, tour.true[:, :3, 3], way, n, trees)
    frames = np.flatnonzero(shown)
    return np.split(frames, np.flatnonzero(np.diff(way[frames]) > SPLIT_DISTANCE) + 1) if len(frames) else []


def _is_seen_again(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    places: NDArray[np.float64],
    distances: Values,
    frame: int,
    trees: list[cKDTree],
) -> bool:
    """Whether earlier passes saw enough of a frame's points, and these points determine the frame's pose."""
    seen = np.zeros(len(points), np.bool_)
    for k in np.flatnonzero(distances[: frame + 1] < distances[frame] - MIN_REVISIT_PATH):
        if np.linalg.norm(places[k] - places[frame]) < 7 and trees[k].n:
            left = np.flatnonzero(~seen)
            seen[left] = np.isfinite(trees[k].query(points[left], distance_upper_bound=SAME_SURFACE)[0])
            if seen.all():
                break
    if not np.mean(seen) >= MIN_SEEN:
        return False
    off, n = points[seen] - places[frame], normals[seen]
    J = np.column_stack([(off[:, 0] * n[:, 1] - off[:, 1] * n[:, 0]) / LEVER, n[:, 0], n[:, 1]])
    return bool(np.linalg.eigvalsh(J.T @ J / len(J))[0] > MIN_INFORMATION)
