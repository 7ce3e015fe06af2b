"""Planar regions of one look: pieces of nearly one normal, and the planes through them.

The thesis lets RANSAC find the planes of a whole class and parts those of one equation by region growing. Here
regions of one normal are grown first: given many parallel ramps at once, RANSAC prefers a level cut through all
of them to any of their slopes. Each region then gets its planes by RANSAC.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.segments.plane import Moments
from pipeline.segments.ransac import plane_inliers
from pipeline.segments.regions_kernels import NONE, claim_nearest, grow_regions, normals
from pipeline.segments.surfels_kernels import make_surfels, neighbours


@dataclass(frozen=True)
class RegionsConfig:
    """Settings of the search for planar regions."""

    block: int = 8
    """pixels, the edge of the image blocks that are averaged to one surfel each."""
    min_pixels: int = 16
    """Of a surfel."""
    min_step: float = 0.01
    """1/m of inverse depth, between surfaces one before the other; a step of a structured-light camera is 0.003."""
    reach: int = 2
    """blocks, how far apart neighbouring surfels are."""
    max_step: float = 0.12
    """m per m of depth, between neighbouring surfels one block apart."""
    max_angle: float = np.deg2rad(20)
    """rad, between a surfel's normal and its region's."""
    max_distance: float = 0.025
    """m, of a surfel from its plane."""
    min_surfels: int = 10
    """Of a plane."""
    iterations: int = 50
    """RANSAC samples per plane."""
    max_shift: float = 0.01
    """m along the optical axis from a pixel of the plane to where its ray meets the plane."""
    noise: float = 0.006
    """m per m² of depth that ``max_shift`` grows: 3σ of a structured-light camera (Nguyen et al. 2012)."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """A thinned look, in the camera's frame: see ``make_surfels`` and ``neighbours``."""

    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    near: NDArray[np.int32]
    of_pixel: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class PlanarRegions:
    """The planes of a look and what belongs to them.

    Attributes:
        surfels: the look, thinned.
        region: (N,) int32 plane of every surfel, NONE for those on none.
        planes: (P, 4) float64 rows [n, d] with n · x = d, in the camera's frame.
    """

    surfels: Surfels
    region: NDArray[np.int32]
    planes: NDArray[np.float64]


def planar_regions(
    frame: Frame, labels: NDArray[np.uint8], seed: int, config: RegionsConfig
) -> PlanarRegions:
    """Grow regions and put planes through them.

    Args:
        frame: the look.
        labels: (H, W) uint8; no region has more than one label, and pixels of label 0 are left out.
        seed: of RANSAC; the same seed and look give the same planes, bit for bit.
        config: settings.
    """
    surfels = _thin(frame, labels, config)
    region, planes = _ransac_regions(surfels, _grow(surfels, config), seed, config)
    return PlanarRegions(surfels, *_settle(surfels, region, planes, config))


def _thin(frame: Frame, labels: NDArray[np.uint8], config: RegionsConfig) -> Surfels:
    """Average away the noise and most of the points; the boundaries between labels are kept."""
    points, surfel_labels, blocks, of_pixel = make_surfels(
        frame.depth, labels, frame.intrinsics.rays, config.block, config.min_pixels, config.min_step
    )
    columns = frame.intrinsics.width // config.block + 1
    near = neighbours(blocks, columns, surfel_labels, points, config.reach, config.max_step)
    return Surfels(points, surfel_labels, near, of_pixel)


def _grow(surfels: Surfels, config: RegionsConfig) -> NDArray[np.int32]:
    """(N,) region of every surfel, grown from the flattest places first."""
    normal, variation = normals(surfels.points, surfels.near)
    order = np.argsort(variation, kind="stable")
    min_cosine = np.cos(config.max_angle)
    return grow_regions(surfels.points, surfels.near, normal, order, min_cosine, config.max_distance)


def _ransac_regions(
    surfels: Surfels, region: NDArray[np.int32], seed: int, config: RegionsConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(N,) plane of every surfel, NONE for outliers, and the (P, 4) planes [n, d] of all regions.

    Large regions come first and keep what lies on their planes: the surfels along the line where two walls meet
    are between both, and would pass for a narrow plane of their own.
    """
    result = np.full(len(region), NONE, np.int32)
    planes = np.empty((0, 4))
    regions = [members for _, members in groups(region) if len(members) >= config.min_surfels]
    for members in sorted(regions, key=len, reverse=True):
        claimed = claim_nearest(surfels.points, surfels.near, members, result, planes, config.max_distance)
        result[members] = claimed
        rest = members[claimed == NONE]
        while len(rest) >= config.min_surfels:
            inlier = plane_inliers(surfels.points[rest], config.max_distance, config.iterations, seed)
            if np.count_nonzero(inlier) < config.min_surfels:
                break
            result[rest[inlier]] = len(planes)
            planes = np.vstack([planes, _fit(surfels.points[rest[inlier]])])
            rest = rest[~inlier]
    return result, planes


def _settle(
    surfels: Surfels, region: NDArray[np.int32], planes: NDArray[np.float64], config: RegionsConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Let every surfel choose the nearest plane around it, and fit again, so that edges fall where planes meet."""
    everyone = np.arange(len(region))
    for _ in range(2):
        region = claim_nearest(surfels.points, surfels.near, everyone, region, planes, config.max_distance)
        planes = planes.copy()
        for number, members in groups(region):
            if len(members) >= config.min_surfels:
                planes[number] = _fit(surfels.points[members])
    return region, planes


def _fit(points: NDArray) -> NDArray[np.float64]:
    """(4,) least-squares plane [n, d]."""
    plane, _ = Moments.of(points).fit()
    return np.append(plane.normal, plane.offset)


def groups(numbers: NDArray) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Every number but NONE that occurs, in order, and where."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=NONE))
    for members in np.split(order, starts)[1:]:
        yield int(numbers[members[0]]), members
