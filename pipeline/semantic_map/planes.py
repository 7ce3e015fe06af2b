"""Planes in one look: region growing and RANSAC (thesis 3.2, figures 4 and 5).

The thesis lets RANSAC find the planes of a whole class and parts those of one equation by region growing. Here
regions of one normal are grown first: given many parallel ramps at once, RANSAC prefers a level cut through all
of them to any of their slopes. Each region then gets its planes by RANSAC, and a plane whose surface has a gap is
parted there by growing again, over the cells that it fills.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.cells import Cells, cells_of, connected_pieces
from pipeline.semantic_map.plane import Moments, Plane
from pipeline.semantic_map.ransac import plane_inliers
from pipeline.semantic_map.regions_kernels import NONE, claim_nearest, grow_regions, normals
from pipeline.semantic_map.surfels_kernels import make_surfels, neighbours, project_pixels
from pipeline.transforms import transform_points


@dataclass(frozen=True)
class PlanesConfig:
    """Settings of the plane search."""

    labels: tuple[Label, ...] = (
        Label.WALL,
        Label.TERRAIN,
        Label.INCLINED_RAMP,
        Label.STRAIGHT_RAMP,
        Label.CEILING,
    )
    """Classes made of planes."""
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
    stride: int = 2
    """Every how many pixels the plane's extent is looked up."""
    max_shift: float = 0.01
    """m along the optical axis from a pixel of the plane to where its ray meets the plane."""
    noise: float = 0.006
    """m per m² of depth that ``max_shift`` grows: 3σ of a structured-light camera (Nguyen et al. 2012)."""
    min_cells: int = 8
    """Of 5 cm, of a piece of plane."""


@dataclass(frozen=True, eq=False)
class PlanePatch:
    """A connected piece of plane in one look, in ``map``.

    Attributes:
        label: its class.
        plane: least-squares plane, normal towards the viewer.
        moments: of the surfels in it.
        points: (N, 3) float32 on the plane: where the rays of its pixels meet it.
        cells: (K, 3) int32 cells of the map that hold these points.
    """

    label: Label
    plane: Plane
    moments: Moments
    points: NDArray[np.float32]
    cells: Cells


@dataclass(frozen=True, eq=False)
class _Surfels:
    """A thinned look, in the camera's frame: see ``make_surfels`` and ``neighbours``."""

    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    near: NDArray[np.int32]
    of_pixel: NDArray[np.int32]


def find_planes(
    frame: Frame,
    labels: NDArray[np.uint8],
    T_map_camera: NDArray[np.float64],
    seed: int,
    config: PlanesConfig | None = None,
) -> list[PlanePatch]:
    """The planes of one look.

    Args:
        frame: the look.
        labels: (N,) uint8 class of every return, row-major.
        T_map_camera: 4×4 pose of the camera.
        seed: of RANSAC; the same seed and look give the same planes, bit for bit.
        config: settings.

    Raises:
        InputError: if there is not one label for every return.
    """
    config = config or PlanesConfig()
    surfels = _thin(frame, labels, config)
    region, planes = _ransac_regions(surfels, _grow(surfels, config), seed, config)
    region, planes = _settle(surfels, region, planes, config)
    points, plane_of_point, surfel = project_pixels(
        frame.depth, frame.intrinsics.rays, T_map_camera, surfels.of_pixel, surfels.near, region, planes,
        config.stride, config.max_shift, config.noise,
    )  # fmt: skip
    centres = transform_points(T_map_camera, surfels.points)
    patches = []
    for number, members in _groups(plane_of_point):
        for inside, cells in _pieces(points[members]):
            # A pixel at an edge may lie on this plane though its surfel, a mean, was given to another one.
            own = np.unique(surfel[members[inside]])
            own = own[region[own] == number]
            if len(own) >= config.min_surfels and len(cells) >= config.min_cells:
                label = Label(surfels.labels[own[0]])
                patches.append(
                    _patch(label, centres[own], points[members[inside]], cells, T_map_camera[:3, 3])
                )
    return patches


def _thin(frame: Frame, labels: NDArray[np.uint8], config: PlanesConfig) -> _Surfels:
    """Average away the noise and most of the points; the boundaries between labels are kept."""
    if labels.shape != (np.count_nonzero(frame.returns),):
        raise InputError(f"planes: {labels.shape} labels for {np.count_nonzero(frame.returns)} returns")
    image = np.zeros(frame.depth.shape, np.uint8)
    image[frame.returns] = np.where(np.isin(labels, config.labels), labels, Label.UNLABELLED)
    points, surfel_labels, blocks, of_pixel = make_surfels(
        frame.depth, image, frame.intrinsics.rays, config.block, config.min_pixels, config.min_step
    )
    columns = frame.intrinsics.width // config.block + 1
    near = neighbours(blocks, columns, surfel_labels, points, config.reach, config.max_step)
    return _Surfels(points, surfel_labels, near, of_pixel)


def _grow(surfels: _Surfels, config: PlanesConfig) -> NDArray[np.int32]:
    """(N,) region of every surfel, grown from the flattest places first."""
    normal, variation = normals(surfels.points, surfels.near)
    order = np.argsort(variation, kind="stable")
    min_cosine = np.cos(config.max_angle)
    return grow_regions(surfels.points, surfels.near, normal, order, min_cosine, config.max_distance)


def _ransac_regions(
    surfels: _Surfels, region: NDArray[np.int32], seed: int, config: PlanesConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(N,) plane of every surfel, NONE for outliers, and the (P, 4) planes [n, d] of all regions.

    Large regions come first and keep what lies on their planes: the surfels along the line where two walls meet
    are between both, and would pass for a narrow plane of their own.
    """
    result = np.full(len(region), NONE, np.int32)
    planes = np.empty((0, 4))
    regions = [members for _, members in _groups(region) if len(members) >= config.min_surfels]
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
    surfels: _Surfels, region: NDArray[np.int32], planes: NDArray[np.float64], config: PlanesConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Let every surfel choose the nearest plane around it, and fit again, so that edges fall where planes meet."""
    everyone = np.arange(len(region))
    for _ in range(2):
        region = claim_nearest(surfels.points, surfels.near, everyone, region, planes, config.max_distance)
        planes = planes.copy()
        for number, members in _groups(region):
            if len(members) >= config.min_surfels:
                planes[number] = _fit(surfels.points[members])
    return region, planes


def _pieces(points: NDArray[np.float32]) -> Iterator[tuple[NDArray[np.intp], Cells]]:
    """The connected pieces of (N, 3) points: which points and which cells."""
    cells, row = cells_of(points)
    piece = connected_pieces(cells, np.bincount(row))
    for number, inside in _groups(piece[row]):
        yield inside, cells[piece == number]


def _patch(
    label: Label, surfels: NDArray, points: NDArray[np.float32], cells: Cells, viewpoint: NDArray[np.float64]
) -> PlanePatch:
    moments = Moments.of(surfels)
    plane, _ = moments.fit()
    return PlanePatch(label, plane.facing(viewpoint - moments.centroid), moments, points, cells)


def _fit(points: NDArray) -> NDArray[np.float64]:
    """(4,) least-squares plane [n, d]."""
    plane, _ = Moments.of(points).fit()
    return np.append(plane.normal, plane.offset)


def _groups(numbers: NDArray) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Every number but NONE that occurs, in order, and where."""
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=NONE))
    for members in np.split(order, starts)[1:]:
        yield int(numbers[members[0]]), members
