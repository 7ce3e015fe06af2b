"""The metric map as OctoMap files: ``.bt`` with free and occupied space only, ``.ot`` with log-odds and colours.

OctoMap (Hornung et al., "OctoMap: an efficient probabilistic 3D mapping framework based on octrees", 2013) has no
grid offset. Voxel (i, j, k) is therefore written as OctoMap's voxel (i, j, k), and a comment in the header gives the
corner of voxel (0, 0, 0) in ``map``, m.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyoctomap import ColorOcTree, OcTree
from scipy.spatial import KDTree

from pipeline.arrays import Labels, Points
from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.metric_map import LOG_ODDS_PER_UNIT, MetricMap

REACH = -int(np.iinfo(np.int16).min)  # Reach of an OctoMap octree, with 16 levels, from the origin, voxels
CLAMP = np.finfo(np.float64).eps  # OctoMap's lower limit of probabilities, less than any in the map


def write_bt(path: Path, metric_map: MetricMap) -> None:
    """Write free and occupied space.

    Raises:
        InputError: the file cannot be written, or the map extends beyond the reach of an octree.
    """
    tree = OcTree(metric_map.voxel_size)
    _add_voxels(tree, metric_map, metric_map.free_centres())
    _add_voxels(tree, metric_map, metric_map.occupied_centres())
    _write(path, metric_map, tree.writeBinary())


def write_ot(path: Path, metric_map: MetricMap, labels: Labels | None = None) -> None:
    """Write the log-odds of free and occupied space, coloured by semantic class.

    Args:
        path: the ``.ot`` file.
        metric_map: the map.
        labels: (N,) classes of ``metric_map.occupied_centres()``, see :func:`voxel_labels`; unlabelled if None.

    Raises:
        InputError: the file cannot be written, or the map extends beyond the reach of an octree.
    """
    tree, occupied = ColorOcTree(metric_map.voxel_size), metric_map.occupied_centres()
    _add_voxels(tree, metric_map, metric_map.free_centres())
    tree.prune()  # Before any voxel has a colour: OctoMap would merge voxels of different colours
    places = _add_voxels(tree, metric_map, occupied)
    labels = np.zeros(len(occupied), np.uint8) if labels is None else labels
    for place, colour in zip(places, COLOURS[labels].tolist(), strict=True):
        tree.setNodeColor(place, *colour)
    if tree.size():  # On an empty tree, the call would crash the process
        tree.updateInnerOccupancy()
    _write(path, metric_map, tree.write())


def _add_voxels(tree: OcTree | ColorOcTree, metric_map: MetricMap, centres: Points) -> NDArray[np.floating]:
    """Add voxels with their log-odds; return their centres (N, 3) in the octree, m."""
    index = metric_map.voxel_index(centres)
    if np.any((index < -REACH) | (index >= REACH)):
        limit = f"an OctoMap octree reaches only {REACH} voxels"
        raise InputError(f"the map extends too far from its origin: {limit}; export it to .ply instead")
    tree.setClampingThresMin(CLAMP)
    tree.setClampingThresMax(1 - CLAMP)
    places = (index + 0.5) * metric_map.voxel_size
    log_odds = (metric_map.log_odds_at(index) * LOG_ODDS_PER_UNIT).tolist()
    for place, value in zip(places, log_odds, strict=True):
        tree.updateNode(place, value, True)
    return places


def _write(path: Path, metric_map: MetricMap, content: bytes) -> None:
    corner = " ".join(repr(value) for value in metric_map.corner.tolist())
    with atomic_write(path) as partial:
        partial.write_bytes(content.replace(b"\n#\n", f"\n# corner {corner}\n".encode(), 1))


def voxel_labels(metric_map: MetricMap, points: Points, labels: Labels) -> Labels:
    """The most frequent class of the points in each occupied voxel.

    Args:
        metric_map: the map whose ``occupied_centres()`` get labels.
        points: (N, 3) points of the semantic map in ``map``, m.
        labels: (N,) classes of the points.

    Returns:
        A label for each centre. A voxel that contains no point (because a noisy return filled it) gets the class of
        the nearest point within one voxel size of its centre, or is unlabelled if there is none.
    """
    centres = metric_map.occupied_centres()
    if not len(centres):
        return np.zeros(0, np.uint8)
    index = metric_map.voxel_index(np.concatenate([points, centres]))
    _, voxel = np.unique(index, axis=0, return_inverse=True)
    ballots = np.bincount(voxel[: len(points)] * len(Label) + labels, minlength=voxel.size * len(Label))
    votes = ballots.reshape(-1, len(Label))[voxel[len(points) :]]
    result = votes.argmax(axis=1).astype(np.uint8)
    empty = ~votes.any(axis=1)
    if empty.any() and len(points):
        _, nearest = KDTree(points).query(centres[empty], distance_upper_bound=metric_map.voxel_size)
        result[empty] = np.append(labels, Label.UNLABELLED)[nearest]
    return result
