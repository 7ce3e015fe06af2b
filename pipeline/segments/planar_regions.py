"""Planar regions of one frame: regions with nearly constant normals, and the planes through them.

In the thesis, RANSAC finds all planes of a class, and region growing separates surfaces on the same plane. Here,
regions with nearly constant normals are grown first, and RANSAC then finds the planes of each region. On many
parallel ramps at once, RANSAC would prefer a level plane through all ramps to the slope of any one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Labels, Planes, Points
from pipeline.frame import Frame
from pipeline.geometry.planes import Moments, plane_inliers
from pipeline.segments.regions_kernels import grow_regions, nearest_regions, normals
from pipeline.segments.surfels_kernels import NONE, make_surfels, neighbours

BLOCK = 8
"""Edge length of an image block, pixels; the mean point of a block is a surfel."""
MIN_PIXELS = 2 * BLOCK
"""Minimum number of pixels of a surfel: as many as two rows of a block have."""
MIN_INVERSE_DEPTH_STEP = 0.01
"""Minimum difference between the mean inverse depths of two surfaces in a block, one behind the other, 1/m.

The value is three times the resolution of a structured-light camera.
"""
MIN_STEP_DEVIATIONS = 5.0
"""Minimum difference between the mean inverse depths of two such surfaces, in standard deviations within a surface.

The two halves of a slope differ by 3.5 standard deviations, the two halves of Gaussian noise by 2.7.
"""
REACH = 2
"""Maximum distance between neighbouring surfels along rows and columns, blocks."""
MAX_SPACING = 0.12
"""Maximum distance between neighbouring surfels one block apart, m per m of depth.

The value is eight times the distance on a surface that faces the camera, so that surfaces stay connected down to a
grazing angle of 7°.
"""
MAX_STEP = 0.025
"""Maximum distance of a surfel from the plane through its neighbour, m, so that regions do not extend over steps."""
MAX_DISTANCE = 0.025
"""Maximum distance of a surfel from its plane, m."""
MIN_SURFELS = 10
"""Minimum number of surfels of a plane."""
RANSAC_SAMPLES = 50
"""Number of RANSAC samples for each plane.

If half of the surfels are inliers, at least one sample consists of three inliers with a probability of 0.999.
"""
ROUNDS = 2
"""Number of times that surfels are reassigned to the nearest plane and the planes are fitted again."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """The surfels of a frame, in ``camera_optical``; see ``make_surfels`` and ``neighbours``.

    Attributes:
        points: mean point of every surfel.
        labels: label of every surfel.
        neighbours: (N, K) int32 neighbours of every surfel, padded with NONE.
        of_pixel: (H, W) int32 surfel of every pixel, or NONE.
    """

    points: Points
    labels: Labels
    neighbours: NDArray[np.int32]
    of_pixel: NDArray[np.int32]

    @classmethod
    def of(cls, frame: Frame, labels: NDArray[np.uint8]) -> Self:
        """Reduce a frame to surfels, which averages out noise; no surfel mixes two of the (H, W) ``labels``."""
        points, surfel_labels, blocks, of_pixel = make_surfels(
            frame.depth, labels, frame.intrinsics.rays, BLOCK, MIN_PIXELS, MIN_INVERSE_DEPTH_STEP, MIN_STEP_DEVIATIONS
        )
        columns = frame.intrinsics.width // BLOCK + 1
        near = neighbours(blocks, columns, surfel_labels, points, REACH, MAX_SPACING)
        return cls(points, surfel_labels, near, of_pixel)


@dataclass(frozen=True, eq=False)
class PlanarRegions:
    """The planes of a frame and the surfels on them.

    Attributes:
        surfels: the surfels of the frame.
        plane_of_surfel: (N,) int32 index of the plane of every surfel; NONE for surfels on no plane.
        planes: the planes in ``camera_optical``.
    """

    surfels: Surfels
    plane_of_surfel: NDArray[np.int32]
    planes: Planes


def planar_regions(frame: Frame, labels: NDArray[np.uint8], seed: int, angle: float) -> PlanarRegions:
    """Grow regions of a frame and fit planes to the regions.

    Args:
        frame: the frame.
        labels: (H, W) uint8; no region has more than one label, and pixels with label 0 are left out.
        seed: seed of RANSAC; the same seed and frame give the same planes, bit for bit.
        angle: maximum angle between the normal of a surfel and the mean normal of its region, rad.
    """
    surfels = Surfels.of(frame, labels)
    points = surfels.points
    near = surfels.neighbours
    # Grow regions with nearly constant normals, starting from the flattest surfels.
    normal, variation = normals(points, near)
    order = np.argsort(variation, kind="stable")
    grown = grow_regions(points, near, normal, order, np.cos(angle), MAX_STEP)
    # Find the planes of each region by RANSAC. Large regions come first, and surfels of later regions may join the
    # planes of earlier ones. Otherwise, the surfels between two walls, along the line where the walls meet, would
    # form a narrow plane of their own.
    region = np.full(len(points), NONE, np.int32)
    planes = np.empty((0, 4))
    large = [members for _, members in groups(grown) if len(members) >= MIN_SURFELS]
    for members in sorted(large, key=len, reverse=True):
        claimed = nearest_regions(points, near, members, region, planes, MAX_DISTANCE)
        region[members] = claimed
        rest = members[claimed == NONE]
        while len(rest) >= MIN_SURFELS:
            inlier = plane_inliers(points[rest], MAX_DISTANCE, RANSAC_SAMPLES, seed)
            if np.count_nonzero(inlier) < MIN_SURFELS:
                break
            region[rest[inlier]] = len(planes)
            planes = np.vstack([planes, _fitted_plane(points[rest[inlier]])])
            rest = rest[~inlier]
    # Reassign every surfel to the nearest plane around it and fit the planes again, so that edges lie where planes
    # meet.
    for _ in range(ROUNDS):
        region = nearest_regions(points, near, np.arange(len(points)), region, planes, MAX_DISTANCE)
        planes = planes.copy()
        for number, members in groups(region):
            if len(members) >= MIN_SURFELS:
                planes[number] = _fitted_plane(points[members])
    return PlanarRegions(surfels, region, planes)


def _fitted_plane(points: Points) -> Planes:
    """The least-squares plane [n, d] of points in ``camera_optical``, with its normal towards the camera."""
    moments = Moments.of(points)
    plane, _ = moments.fit(-moments.centroid)
    return np.append(plane.normal, plane.offset)


def groups(numbers: NDArray) -> Iterator[tuple[int, Indices]]:
    """Yield each distinct number in an array (N,) except NONE, in ascending order, with the number's indices."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=NONE))
    for members in np.split(order, starts)[1:]:
        yield int(numbers[members[0]]), members
