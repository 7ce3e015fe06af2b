"""The semantic map: a labelled point for every 2 cm voxel that was ever hit (thesis 3.2, figure 3)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from pipeline.semantic_map.ply import write_ply
from pipeline.semantic_map.semantic_map_kernels import EMPTY, accumulate, insert_all


@dataclass(frozen=True)
class SemanticMapConfig:
    """Settings of the semantic map.

    Attributes:
        voxel_size: m, the edge of the voxels; a voxel keeps one point whatever the number of looks.
    """

    voxel_size: float = 0.02


class VoxelTable:
    """Points, averaged per voxel; memory grows with the surface seen, not with the number of points.

    Means, evidence and hits are kept in the order in which the voxels were first hit, so the same points in the same
    order give the same table.
    """

    def __init__(self, voxel_size: float, classes: int) -> None:
        """An empty table of voxels of ``voxel_size`` m with ``classes`` evidence columns."""
        if not voxel_size > 0:
            raise InputError(f"voxel size {voxel_size} m: must be positive")
        self._per_metre = 1 / voxel_size
        self._count = 0
        self._voxel_keys = np.empty(0, np.int64)
        self._means = np.empty((0, 3), np.float32)
        self._evidence = np.empty((0, classes), np.float32)
        self._hits = np.empty(0, np.uint32)

    def add(
        self, points: NDArray[np.float32], evidence: NDArray[np.float32], tags: NDArray[np.uint8]
    ) -> None:
        """Add (N, 3) points with (N, C) evidence; points of different ``tags`` (N,) share no voxel entry."""
        self._reserve(self._count + len(points))
        self._count = accumulate(
            points, evidence, tags, self._per_metre, self._keys, self._indices, self._shift, self._count,
            self._voxel_keys, self._means, self._evidence, self._hits,
        )  # fmt: skip

    def _reserve(self, wanted: int) -> None:
        """Make room for ``wanted`` voxels; at least doubling keeps the mean cost of growth constant."""
        if wanted <= len(self._voxel_keys):
            return
        bits = max(wanted - 1, 1).bit_length()
        for name in ("_voxel_keys", "_means", "_evidence", "_hits"):
            old = getattr(self, name)
            new = np.empty((1 << bits, *old.shape[1:]), old.dtype)
            new[: self._count] = old[: self._count]
            setattr(self, name, new)
        # Twice the slots: a table half full at most.
        self._keys = np.full(2 << bits, EMPTY, np.int64)
        self._indices = np.empty(2 << bits, np.int32)
        self._shift = 64 - (bits + 1)
        insert_all(self._keys, self._indices, self._shift, self._voxel_keys[: self._count])

    @property
    def means(self) -> NDArray[np.float32]:
        """(M, 3) mean point per voxel."""
        return self._means[: self._count]

    @property
    def evidence(self) -> NDArray[np.float32]:
        """(M, C) summed evidence per voxel."""
        return self._evidence[: self._count]

    @property
    def hits(self) -> NDArray[np.uint32]:
        """(M,) number of points per voxel."""
        return self._hits[: self._count]

    @property
    def tags(self) -> NDArray[np.uint8]:
        """(M,) tag per voxel."""
        return (self._voxel_keys[: self._count] & 7).astype(np.uint8)


class SemanticMap:
    """Labelled points, fused over all looks."""

    def __init__(self, config: SemanticMapConfig | None = None) -> None:
        """An empty map."""
        self.config = config or SemanticMapConfig()
        self._table = VoxelTable(self.config.voxel_size, len(Label))

    def __len__(self) -> int:
        """Number of points in the map."""
        return len(self._table.hits)

    def update(self, points: NDArray[np.float32], probabilities: NDArray[np.float32]) -> None:
        """Add a look.

        A voxel's class evidence is the sum of the probabilities of its points. They are not multiplied: pixels side by
        side err together, so a product would be far too sure.

        Args:
            points: (N, 3) float32 in ``map``; those that are not finite are left out.
            probabilities: (N, 8) float32 class probabilities.

        Raises:
            InputError: if the shapes do not fit.
        """
        _check_shapes(points, probabilities, len(Label))
        self._table.add(points, probabilities, np.zeros(len(points), np.uint8))

    def points(self) -> NDArray[np.float32]:
        """(M, 3) float32 mean point of every voxel, in ``map``, oldest first."""
        return self._table.means.copy()

    def labels(self) -> NDArray[np.uint8]:
        """(M,) uint8 most probable class; the lower id wins a tie."""
        return self._table.evidence.argmax(axis=1).astype(np.uint8)

    def probabilities(self) -> NDArray[np.float32]:
        """(M, 8) float32 class probabilities, the mean over all points of the voxel."""
        return self._table.evidence / self._table.hits[:, None].astype(np.float32)

    def hits(self) -> NDArray[np.uint32]:
        """(M,) uint32 number of points that fell in every voxel."""
        return self._table.hits.copy()

    def save(self, path: Path) -> None:
        """Write a binary PLY with ``x y z``, ``red green blue`` of the label, and ``label``; InputError if it cannot."""
        labels = self.labels()
        write_ply(path, self.points(), COLOURS[labels], labels)


def downsample(
    points: NDArray[np.float32], labels: NDArray[np.uint8], voxel_size: float
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """One point per voxel and label: the mean of its points.

    Points of different labels are not averaged, so at an edge between two surfaces neither is bent.

    Args:
        points: (N, 3) float32; those that are not finite are left out.
        labels: (N,) uint8.
        voxel_size: m.

    Returns:
        (M, 3) float32 points and their (M,) uint8 labels, in the order of their first point.
    """
    _check_shapes(points, labels[:, None], 1)
    table = VoxelTable(voxel_size, 0)
    table.add(points, np.empty((len(points), 0), np.float32), labels)
    return table.means.copy(), table.tags


def _check_shapes(points: NDArray, weights: NDArray, classes: int) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or weights.shape != (len(points), classes):
        raise InputError(
            f"points {points.shape} and classes {weights.shape}: expected (N, 3) and (N, {classes}) of one N"
        )
