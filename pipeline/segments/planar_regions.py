"""Planar regions of one frame: regions with nearly the same normal, and the planes through them.

In the thesis RANSAC finds the planes of a whole class, and region growing separates surfaces on the same plane. Here
regions of one normal are grown first: given many parallel ramps at once, RANSAC prefers a level cut through all
of them to any of their slopes. Each region then gets its planes by RANSAC.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.geometry.cells import JOINED, SURFACE_CELL
from pipeline.segments.plane import Moments
from pipeline.segments.regions_kernels import claim_nearest, grow_regions, normals
from pipeline.segments.surfels_kernels import NONE, make_surfels, neighbours

SURFEL = 8  # pixels, the edge of the image blocks that are averaged to one surfel each; at least two rows of pixels
MIN_DEPTH_STEP = 0.01
"""1/m of inverse depth, between surfaces one behind the other: three times a structured-light camera's resolution."""
MAX_SPACING = 0.12
"""m per m of depth, between neighbouring surfels one block apart: eight times their distance on a surface that the
camera faces, so that a surface is seen as one down to a grazing angle of 7°."""
MIN_SURFELS = 10  # Of a plane
RANSAC_SAMPLES = 50
"""For each plane: one of them has three inliers with a probability of 0.999 if half of the surfels are inliers."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """A thinned frame, in ``camera_optical``: see ``make_surfels`` and ``neighbours``.

    Attributes:
        points: (N, 3) float32 mean points, m.
        labels: (N,) uint8.
        near: (N, K) int32 neighbours of every surfel, ending with NONE.
        of_pixel: (H, W) int32 surfel of every pixel, or NONE.
    """

    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    near: NDArray[np.int32]
    of_pixel: NDArray[np.int32]

    @classmethod
    def of(cls, frame: Frame, labels: NDArray[np.uint8]) -> Self:
        """Thin a frame, which averages out its noise; the boundaries between (H, W) labels are kept."""
        points, surfel_labels, blocks, of_pixel = make_surfels(
            frame.depth, labels, frame.intrinsics.rays, SURFEL, 2 * SURFEL, MIN_DEPTH_STEP
        )
        columns = frame.intrinsics.width // SURFEL + 1
        near = neighbours(blocks, columns, surfel_labels, points, JOINED, MAX_SPACING)
        return cls(points, surfel_labels, near, of_pixel)


@dataclass(frozen=True, eq=False)
class PlanarRegions:
    """The planes of a frame and the surfels on them.

    Attributes:
        surfels: the thinned frame.
        region: (N,) int32 plane of every surfel, NONE for surfels on no plane.
        planes: (P, 4) float64 rows [n, d] in ``camera_optical``: see :mod:`pipeline.segments.plane`.
    """

    surfels: Surfels
    region: NDArray[np.int32]
    planes: NDArray[np.float64]


def planar_regions(frame: Frame, labels: NDArray[np.uint8], seed: int, max_angle: float) -> PlanarRegions:
    """Grow regions and fit planes to them.

    Args:
        frame: one frame.
        labels: (H, W) uint8; no region has more than one label, and pixels of label 0 are left out.
        seed: of RANSAC; the same seed and frame give the same planes, bit for bit.
        max_angle: rad, between a surfel's normal and its region's.
    """
    surfels = Surfels.of(frame, labels)
    region, planes = _ransac_regions(surfels, _grow(surfels, max_angle), seed)
    return PlanarRegions(surfels, *_settle(surfels, region, planes))


def _grow(surfels: Surfels, max_angle: float) -> NDArray[np.int32]:
    """(N,) region of every surfel; the flattest surfels are the first seeds."""
    normal, variation = normals(surfels.points, surfels.near)
    order = np.argsort(variation, kind="stable")
    return grow_regions(surfels.points, surfels.near, normal, order, np.cos(max_angle), SURFACE_CELL / 2)


def _ransac_regions(
    surfels: Surfels, region: NDArray[np.int32], seed: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(N,) plane of every surfel, NONE for outliers, and the (P, 4) planes [n, d] of all regions.

    Large regions come first and claim all surfels on their planes: the surfels along the line where two walls meet
    lie between both, and would form a narrow plane of their own.
    """
    result = np.full(len(region), NONE, np.int32)
    planes = np.empty((0, 4))
    regions = [members for _, members in groups(region) if len(members) >= MIN_SURFELS]
    for members in sorted(regions, key=len, reverse=True):
        claimed = claim_nearest(surfels.points, surfels.near, members, result, planes, SURFACE_CELL / 2)
        result[members] = claimed
        rest = members[claimed == NONE]
        while len(rest) >= MIN_SURFELS:
            inlier = plane_inliers(surfels.points[rest], SURFACE_CELL / 2, RANSAC_SAMPLES, seed)
            if np.count_nonzero(inlier) < MIN_SURFELS:
                break
            result[rest[inlier]] = len(planes)
            planes = np.vstack([planes, _fit(surfels.points[rest[inlier]])])
            rest = rest[~inlier]
    return result, planes


def plane_inliers(points: NDArray[np.float32], max_distance: float, samples: int, seed: int) -> NDArray[np.bool_]:
    """The inliers of the plane with the most inliers, by RANSAC (Fischler & Bolles 1981).

    The same seed gives the same plane, bit for bit. For that Open3D must try all samples, hence the probability of 1:
    with less it stops early, after a number of samples that depends on the timing of its threads.

    Args:
        points: (N, 3) float32, N ≥ 3.
        max_distance: m, from the plane.
        samples: number of random planes.
        seed: of the samples; it seeds Open3D as a whole.

    Returns:
        (N,) bool.
    """
    import open3d as o3d  # here, because it takes a second, which would delay every command's --help

    o3d.utility.random.seed(seed & np.iinfo(np.int32).max)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    (*normal, minus_offset), _ = cloud.segment_plane(max_distance, 3, samples, probability=1.0)
    return np.abs(points @ np.array(normal) + minus_offset) < max_distance


def _settle(
    surfels: Surfels, region: NDArray[np.int32], planes: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Assign every surfel to the nearest plane around it, and fit again, so that edges lie where planes meet."""
    everything = np.arange(len(region))
    for _ in range(2):
        region = claim_nearest(surfels.points, surfels.near, everything, region, planes, SURFACE_CELL / 2)
        planes = planes.copy()
        for number, members in groups(region):
            if len(members) >= MIN_SURFELS:
                planes[number] = _fit(surfels.points[members])
    return region, planes


def _fit(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """(4,) least-squares plane [n, d] of points in ``camera_optical``."""
    moments = Moments.of(points)
    plane, _ = moments.fit(-moments.centroid)
    return np.append(plane.normal, plane.offset)


def groups(numbers: NDArray) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Every number in an array except NONE, in order, with the (N,) indices of its elements."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=NONE))
    for members in np.split(order, starts)[1:]:
        yield int(numbers[members[0]]), members
