"""The robot's 3D occupancy grid (thesis 3.1): each voxel is free, occupied or unknown."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from math import prod

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from pipeline.arrays import Boxes, Cells, Depth, Direction, Mask, MaskLayer, Place, Places, Points, Pose
from pipeline.errors import InputError, required
from pipeline.frame import Intrinsics
from pipeline.grid_map import Grid, check_memory
from pipeline.metric_map.blocks import BlockArray, block_parts
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.grid_kernels import WORD, has_marks, update_log_odds
from pipeline.metric_map.updates import Scan, ScanBuilder
from pipeline.transforms import FARTHEST, POSE_REQUIREMENT, are_poses

OCCUPIED, UNKNOWN, FREE = 0.0, 0.5, 1.0  # The thesis's three values of a voxel: the probability that it is free

LOG_ODDS_PER_UNIT = 0.1  # Log-odds per unit of the map's int8 values
COLUMN = 8  # Side of the columns that are rebuilt, voxels


class MetricMap:
    """Which voxels of the ``map`` frame are free, occupied or unknown.

    The value of a voxel is the int8 log-odds that it is occupied (0 = unknown); :meth:`p_free_at` returns the values
    of the thesis. A frame changes only the voxels in view, so the time of an update does not depend on the size of
    the environment.

    Attributes:
        config: the settings, of which ``voxel_size`` and ``max_range``, m, are also attributes of the map itself.
        corner: (3,) lower corner of voxel (0, 0, 0) in ``map``, m.
    """

    def __init__(self, config: MetricMapConfig = MetricMapConfig()) -> None:
        self.config, self.voxel_size, self.max_range = config, config.voxel_size, config.max_range
        self.corner: Place = np.array(config.offset) * config.voxel_size
        self._log_odds = BlockArray(config.max_bytes)
        self._rebuilding: tuple[Grid, MaskLayer] | None = None
        self._scan_builder = ScanBuilder(config)

    @property
    def nbytes(self) -> int:
        """Memory of the voxels' values, bytes."""
        return self._log_odds.nbytes

    @contextmanager
    def rebuilding(self, boxes: Boxes) -> Iterator[Callable[[Boxes], Mask]]:
        """Empty the columns that boxes in ``map`` touch; the body of the ``with`` statement must fill them again.

        The body must add all scans that touch these columns. Meanwhile, other columns do not change.

        Yields:
            A function that returns whether each of some other boxes touches these columns.
        """
        columns = Grid.around(boxes - self.corner, COLUMN * self.voxel_size)
        within, meets = columns.touched_by(boxes - self.corner)
        self._rebuilding = columns, within
        for first, block in self._log_odds.items():
            block[self._are_rebuilt(first, block.shape)] = 0
        try:
            yield lambda others: meets(others - self.corner)
        finally:
            self._rebuilding = None

    def _are_rebuilt(self, lower: NDArray[np.int64], shape: tuple[int, ...]) -> MaskLayer:
        """(nx, ny) whether voxels of a box, given by its first index and shape, are in columns being rebuilt."""
        columns, within = required(self._rebuilding)
        axes = zip(lower[:2], shape[:2], columns.low, columns.shape, strict=True)
        # The columns at the edge of their grid are never rebuilt, so voxels beyond it may be clipped to them.
        i, j = (((v + np.arange(n)) // COLUMN - low).clip(0, size - 1) for v, n, low, size in axes)
        return within[np.ix_(i, j)]

    def integrate(
        self, depth: Depth, intrinsics: Intrinsics, T_map_camera: Pose, returns: Points | None = None
    ) -> None:
        """Add a depth image.

        Args:
            depth: depth image, m; a value that is not positive and finite means no return.
            intrinsics: intrinsics of the depth image.
            T_map_camera: pose of ``camera_optical``.
            returns: (N, 3) additional end points in ``map``, m. If they contain all returns, ``depth`` may be
                subsampled by :meth:`stride`, and still shows free space as well as the full image does.

        Raises:
            InputError: the intrinsics do not fit the image, the pose is not rigid, or the map is full. The map is
                unchanged.
        """
        _check_image(depth, intrinsics)
        T_grid_camera = _checked_pose(T_map_camera)
        T_grid_camera[:3, 3] -= self.corner
        ends = np.zeros((0, 3), np.float32) if returns is None else returns - self.corner.astype(np.float32)
        self._add_scan(
            self._scan_builder.project(np.ascontiguousarray(depth, np.float32), intrinsics, T_grid_camera, ends)
        )

    def stride(self, intrinsics: Intrinsics) -> int:
        """Subsampling step that leaves three pixels across a voxel at maximum range, which suffice for free space."""
        return max(1, int(intrinsics.fx * self.voxel_size / (3 * self.max_range)))

    def integrate_points(self, points: ArrayLike, origin: ArrayLike) -> None:
        """Add a point cloud, ray by ray from its origin.

        Args:
            points: (N, 3) in ``map``, m; a point is left out if a coordinate is not finite or beyond ±FARTHEST.
            origin: (3,) position of the sensor in ``map``, m.

        Raises:
            InputError: a shape is wrong, the origin is out of range, or the map is full. The map is unchanged.
        """
        cloud, start = _checked_points(points), np.asarray(origin, np.float64)
        if start.shape != (3,) or not np.abs(start).max() <= FARTHEST:
            limits = f"three numbers from -{FARTHEST:.0f} to {FARTHEST:.0f} m"
            raise InputError(f"the origin of a point cloud must be {limits}, not {start.tolist()}")
        cloud = cloud[(np.abs(cloud) <= FARTHEST).all(axis=1)] - self.corner
        if len(cloud):
            self._add_scan(self._scan_builder.trace(cloud, start - self.corner))

    def voxel_index(self, points: ArrayLike) -> Cells:
        """(N, 3) indices of the voxels that contain points (N, 3) in ``map``, m; InputError for another shape."""
        return np.floor((_checked_points(points) - self.corner) / self.voxel_size).astype(np.int64)

    def voxel_centre(self, index: Cells) -> Points:
        """(N, 3) centres in ``map``, m, of voxels with indices (N, 3)."""
        return ((index + 0.5) * self.voxel_size + self.corner).astype(np.float32)

    def bounds(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(3,) first index and (3,) one past the last index of the box around all known voxels."""
        return self._log_odds.bounds()

    def log_odds(self, lower: NDArray[np.int64], upper: NDArray[np.int64]) -> NDArray[np.int8]:
        """A copy of the voxels from index ``lower`` (inclusive) to ``upper`` (exclusive).

        Returns:
            (nx, ny, nz) int8 log-odds in units of LOG_ODDS_PER_UNIT: > 0 occupied, < 0 free, 0 unknown.

        Raises:
            InputError: the copy would take too much memory.
        """
        shape = tuple((upper - lower).tolist())
        check_memory(f"a map of {' × '.join(map(str, shape))} voxels", prod(shape))
        return self._log_odds.read(lower, shape)

    def log_odds_at(self, index: Cells) -> NDArray[np.int8]:
        """(N,) int8 log-odds, in units of LOG_ODDS_PER_UNIT, of voxels with indices (N, 3)."""
        return self._log_odds.at(index)

    def set_log_odds(self, lower: NDArray[np.int64], values: NDArray[np.int8]) -> None:
        """Overwrite the box of voxels that begins at index ``lower`` with (nx, ny, nz) int8 log-odds.

        Raises:
            InputError: the map is full.
        """
        self._log_odds.write(lower, np.clip(values, self.config.min_log_odds, self.config.max_log_odds))

    def p_free_at(self, points: ArrayLike) -> NDArray[np.float32]:
        """(N,) float32 1 (free), 0.5 (unknown) or 0 (occupied) at points (N, 3) in ``map``, m.

        These are the thesis's values; most libraries give the probability that a voxel is occupied instead.
        """
        signs = np.sign(self.log_odds_at(self.voxel_index(points)))
        return np.array((UNKNOWN, OCCUPIED, FREE), np.float32)[signs]

    def is_seen_through(self, points: Points) -> Mask:
        """(N,) whether points lie in free space and not next to an occupied voxel.

        The surfaces to which such points belonged must be gone.
        """
        index = self.voxel_index(points)
        gone = self.log_odds_at(index) < 0
        for step in product((-1, 0, 1), repeat=3):
            gone[gone] = self.log_odds_at(index[gone] + np.array(step)) <= 0
        return gone

    def is_surface(self, points: Places, normal: Direction) -> Mask:
        """(N,) whether points are occupied, with free space in front of them on the side to which ``normal`` points.

        The voxels of a thin wall represent both of its sides; in front of a side that no frame has shown, space is
        unknown. Noise spreads a surface over at most two voxels; inside an object on the surface, more are occupied.
        """
        before, next_before = (self.p_free_at(points + n * self.voxel_size * normal) for n in (1, 2))
        is_open = (before == FREE) | (before == OCCUPIED) & (next_before == FREE)
        return (self.p_free_at(points) == OCCUPIED) & is_open

    def are_sightlines_free(
        self,
        starts: Places,
        end: Place,
        target: cKDTree,
        margin: float,
        skip: float = 0.0,
        step: float | None = None,
        may_be_unknown: bool = False,
    ) -> Mask:
        """(N,) whether the line of sight from each of ``starts`` to ``end`` is free, at least up to the target.

        Args:
            starts, end: (N, 3) and (3,) ends of the lines in ``map``, m.
            target: k-d tree of the target's (M, 3) points in ``map``, m.
            margin: distance from the nearest target point at which the line of sight ends, m.
            skip: length from ``starts`` that is assumed to be free, m.
            step: spacing of the points on a line that are checked, m; half a voxel if None.
            may_be_unknown: whether unknown space is treated as free.
        """
        ways = end - starts
        lengths = np.linalg.norm(ways, axis=1)
        along = np.arange(skip, lengths.max(initial=0.0), step or self.voxel_size / 2)
        line, k = np.nonzero(along < lengths[:, None])
        points = starts[line] + (along[k] / lengths[line])[:, None] * ways[line]
        # A line of sight is free if it reaches the target before it meets an obstacle.
        is_there, is_barred = np.zeros((2, len(starts), len(along) + 1), np.bool_)
        is_there[line, k] = target.query(points)[0] <= margin
        is_barred[line, k] = self.p_free_at(points) < (UNKNOWN if may_be_unknown else FREE)
        is_there[:, -1] = is_barred[:, -1] = True
        return np.asarray(is_there.argmax(axis=1) <= is_barred.argmax(axis=1))

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of occupied and of free voxels."""
        blocks = [block for _, block in self._log_odds.items()]
        return sum(int(np.count_nonzero(b > 0)) for b in blocks), sum(int(np.count_nonzero(b < 0)) for b in blocks)

    def occupied_centres(self) -> Points:
        """(N, 3) centres of the occupied voxels, m; InputError if they take too much memory."""
        return self._centres([(first, block > 0) for first, block in self._log_odds.items()])

    def free_centres(self) -> Points:
        """(N, 3) centres of the free voxels, m; InputError if they take too much memory."""
        return self._centres([(first, block < 0) for first, block in self._log_odds.items()])

    def _centres(self, chosen: list[tuple[NDArray[np.int64], NDArray[np.bool_]]]) -> Points:
        """Centres of voxels; ``chosen``: per block, the index of its first voxel and the mask of the voxels."""
        count = sum(int(np.count_nonzero(mask)) for _, mask in chosen)
        # An export holds two copies of each centre and two of its vertex, which is about as large.
        check_memory(f"a list of {count} voxels", 2 * count * (3 * np.dtype(np.float64).itemsize))
        centres = [self.voxel_centre(np.argwhere(mask) + first) for first, mask in chosen]
        return np.concatenate([np.zeros((0, 3), np.float32), *centres])

    def _add_scan(self, scan: Scan) -> None:
        if self._rebuilding is not None:
            scan.marks[~self._are_rebuilt(scan.lower, scan.marks.shape)] = 0
        words = scan.marks.view(np.uint64)  # Eight marks each
        marked = []
        for key, (i, j, k), in_block in block_parts(scan.lower, scan.marks.shape):
            part = words[i, j, k.start // WORD : k.stop // WORD]
            if key in self._log_odds or has_marks(part):
                marked.append((key, part, in_block))
        self._log_odds.reserve(key for key, _, _ in marked)
        c = self.config
        for key, part, in_block in marked:
            update_log_odds(part, self._log_odds[key][in_block], c.hit, c.miss, c.min_log_odds, c.max_log_odds)


def _check_image(depth: Depth, intrinsics: Intrinsics) -> None:
    expected = (intrinsics.height, intrinsics.width)
    if depth.shape != expected or not depth.size:
        raise InputError(f"a depth image of shape {depth.shape} is empty or does not fit intrinsics for {expected}")
    if not (0.01 <= intrinsics.fx <= 1e6 and 0.01 <= intrinsics.fy <= 1e6):
        raise InputError(f"focal lengths must be from 0.01 to 1e6 pixels, not {intrinsics.fx} and {intrinsics.fy}")
    if not (abs(intrinsics.cx) <= 1e6 and abs(intrinsics.cy) <= 1e6):
        raise InputError(f"the principal point must be within ±1e6 pixels, not {intrinsics.cx}, {intrinsics.cy}")


def _checked_pose(T: Pose) -> Pose:
    """A float64 copy of a matrix; InputError if the matrix is not a pose."""
    if np.ndim(T) != 2 or not are_poses(T):
        raise InputError(f"the pose of a depth image must be {POSE_REQUIREMENT}")
    return np.array(T, np.float64)


def _checked_points(points: ArrayLike) -> NDArray[np.float64]:
    cloud = np.asarray(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise InputError(f"points must have shape (N, 3), not {cloud.shape}")
    return cloud
