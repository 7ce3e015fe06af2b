"""The metric map's twin as an octree coloured by semantic class (the thesis's way by RTAB-Map and PCL)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.metric_map.metric_map import MetricMap, MetricMapConfig

DEPTH = 16
"""Levels below the root, as in OctoMap: 65,536 voxels along every axis, half of them on either side of zero."""
_CENTRE = 1 << (DEPTH - 1)
_LEAF = np.dtype([("code", np.int64), ("level", np.int64), ("log_odds", np.int8), ("label", np.uint8)])


@dataclass(frozen=True, eq=False)
class Octree:
    """The known part of a metric map as cubes, each as large as its content is uniform.

    Attributes:
        voxel_size: m along the side of a single voxel.
        corner: (3,) float64, m in ``map``, where voxel (0, 0, 0) begins.
        code: (N,) int64, place of each leaf among those of its size: the bits of x, y and z interleaved, x lowest.
        level: (N,) int64; a leaf is 2^level voxels along a side.
        log_odds: (N,) int8, in units of the metric map's LOG_ODDS: > 0 occupied, < 0 free.
        label: (N,) uint8 semantic class; of free leaves unlabelled.
    """

    voxel_size: float
    corner: NDArray[np.float64]
    code: NDArray[np.int64]
    level: NDArray[np.int64]
    log_odds: NDArray[np.int8]
    label: NDArray[np.uint8]

    @classmethod
    def from_metric_map(cls, metric_map: MetricMap, labels: NDArray[np.uint8] | None = None) -> Octree:
        """The octree of a map.

        Args:
            metric_map: whose voxels to take.
            labels: (N,) uint8 of ``metric_map.occupied_centres()``, see :func:`voxel_labels`; unlabelled if absent.

        Raises:
            InputError: if the map reaches farther than an octree of this depth does.
        """
        occupied = metric_map.voxel_index(metric_map.occupied_centres())
        free = metric_map.voxel_index(metric_map.free_centres())
        index = np.concatenate([occupied, free])
        label = np.zeros(len(index), np.uint8)
        label[: len(occupied)] = 0 if labels is None else labels
        level = np.zeros(len(index), np.int64)
        leaves = _merge(encode(index), level, metric_map.log_odds_at(index), label)
        return cls(metric_map.config.voxel_size, metric_map.corner, *leaves)

    def to_metric_map(self, config: MetricMapConfig | None = None) -> MetricMap:
        """The same as a metric map, laid out like the octree and otherwise as ``config`` says.

        Raises:
            InputError: if it would exceed the map's bound on memory.
        """
        settings = vars(config or MetricMapConfig()) | {
            "voxel_size": self.voxel_size,
            "offset": tuple((self.corner / self.voxel_size).tolist()),
        }
        metric_map = MetricMap(MetricMapConfig(**settings))
        side = 1 << self.level
        if (side.astype(np.float64) ** 3).sum() > metric_map.config.max_bytes:
            raise InputError(f"the octree exceeds the map's bound of {metric_map.config.max_bytes} bytes")
        for first, length, value in zip(self.index, side.tolist(), self.log_odds, strict=True):
            metric_map.set_log_odds(first, np.full((length,) * 3, value))
        return metric_map

    def binary(self, free: int, occupied: int) -> Octree:
        """The same with one value of log-odds for all free leaves and one for all occupied ones, and no labels."""
        log_odds = np.where(self.log_odds > 0, occupied, free).astype(np.int8)
        leaves = _merge(self.code, self.level, log_odds, np.zeros_like(self.label))
        return Octree(self.voxel_size, self.corner, *leaves)

    @property
    def index(self) -> NDArray[np.int64]:
        """(N, 3) int64 index of the first voxel of each leaf."""
        return decode(self.code << (3 * self.level))

    @property
    def centres(self) -> NDArray[np.float32]:
        """(N, 3) float32 centres of the leaves, m in ``map``."""
        half = 0.5 * self.sides[:, None]
        return (self.index * self.voxel_size + self.corner + half).astype(np.float32)

    @property
    def sides(self) -> NDArray[np.float64]:
        """(N,) m along the sides of the leaves."""
        return np.ldexp(self.voxel_size, self.level)


def voxel_labels(
    metric_map: MetricMap, points: NDArray[np.float32], labels: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """The class that most points in each occupied voxel have.

    Args:
        metric_map: whose ``occupied_centres()`` get labels.
        points: (N, 3) m in ``map``.
        labels: (N,) uint8 of the points.

    Returns:
        (M,) uint8. A voxel without a point, which a return off the surface filled, gets the class of the nearest
        point within a voxel's side of its centre, and is unlabelled if there is none.
    """
    centres = metric_map.occupied_centres()
    if not len(centres):
        return np.zeros(0, np.uint8)
    votes = _votes(metric_map, encode(metric_map.voxel_index(centres)), points, labels)
    result = votes.argmax(axis=1).astype(np.uint8)
    empty = ~votes.any(axis=1)
    if empty.any() and len(points):
        _, nearest = KDTree(points).query(centres[empty], distance_upper_bound=metric_map.config.voxel_size)
        result[empty] = np.append(labels, Label.UNLABELLED)[nearest]
    return result


def _votes(
    metric_map: MetricMap, voxels: NDArray[np.int64], points: NDArray[np.float32], labels: NDArray[np.uint8]
) -> NDArray[np.int64]:
    """(M, classes) points of each class in each voxel."""
    order = np.argsort(voxels)
    index = metric_map.voxel_index(points)
    near = np.all(np.abs(index) < _CENTRE, axis=1)
    wanted = encode(index[near])
    place = order[np.searchsorted(voxels, wanted, sorter=order).clip(max=len(voxels) - 1)]
    inside = voxels[place] == wanted
    votes = np.bincount(place[inside] * len(Label) + labels[near][inside], minlength=len(voxels) * len(Label))
    return votes.reshape(-1, len(Label))


def encode(index: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) int64 codes of the voxels with (N, 3) indices.

    Raises:
        InputError: if an index is out of the octree's reach.
    """
    key = index + _CENTRE
    if np.any((key < 0) | (key >= 2 * _CENTRE)):
        raise InputError(
            f"an octree of {DEPTH} levels reaches {_CENTRE} voxels from the map's origin, not farther"
        )
    code = np.zeros(len(index), np.int64)
    for bit in range(DEPTH):
        for axis in range(3):
            code |= ((key[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def decode(code: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 3) int64 indices of the voxels with (N,) codes."""
    key = np.zeros((len(code), 3), np.int64)
    for bit in range(DEPTH):
        for axis in range(3):
            key[:, axis] |= ((code >> (3 * bit + axis)) & 1) << bit
    return key - _CENTRE


def _merge(
    code: NDArray[np.int64], level: NDArray[np.int64], log_odds: NDArray[np.int8], label: NDArray[np.uint8]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int8], NDArray[np.uint8]]:
    """Unite eight equal siblings to a larger leaf, level by level, as often as that can be done."""
    leaves = np.empty(len(code), _LEAF)
    leaves["code"], leaves["level"], leaves["log_odds"], leaves["label"] = code, level, log_odds, label
    done, merged = [], leaves[:0]
    for height in range(DEPTH + 1):
        nodes = np.concatenate([merged, leaves[level == height]])
        nodes = nodes[np.argsort(nodes["code"])]
        first = np.flatnonzero(np.diff(nodes["code"] >> 3, prepend=-1))
        count = np.diff(first, append=len(nodes))
        whole = (count == 8) & _uniform(nodes["log_odds"], first) & _uniform(nodes["label"], first)
        done.append(nodes[~np.repeat(whole, count)])
        merged = nodes[first[whole]]
        merged["code"] >>= 3
        merged["level"] += 1
    leaves = np.concatenate(done)
    return leaves["code"], leaves["level"], leaves["log_odds"], leaves["label"]


def _uniform(values: NDArray, first: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Are the values from each ``first`` to the next all the same?"""
    if not len(first):
        return np.zeros(0, np.bool_)
    return np.minimum.reduceat(values, first) == np.maximum.reduceat(values, first)
