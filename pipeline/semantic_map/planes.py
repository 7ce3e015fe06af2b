"""Planes in one look: region growing and RANSAC (thesis 3.2, figures 4 and 5).

The thesis lets RANSAC find the planes of a whole class and parts those of one equation by region growing. Here
regions of one normal are grown first: given many parallel ramps at once, RANSAC prefers a level cut through all
of them to any of their slopes. Each region then gets its planes by RANSAC, and a plane whose surface has a gap is
parted there.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.cells import Cells, cells_of, connected_pieces
from pipeline.semantic_map.plane import Moments, Plane
from pipeline.semantic_map.regions_kernels import claim_nearest, grow_regions, normals
from pipeline.semantic_map.surfels_kernels import NONE, make_surfels, neighbours, project_pixels
from pipeline.transforms import transform_points


@dataclass(frozen=True)
class PlanesConfig:
    """Settings of the plane search.

    Attributes:
        labels: classes made of planes.
        block: pixels, the edge of the image blocks that are averaged to one surfel each.
        min_pixels: of a surfel.
        max_residual: 1/m, rms deviation of a surfel's inverse depths from those of a plane.
        max_step: m per m of depth, between surfels of adjacent blocks that hang together.
        max_angle: rad, between a surfel's normal and its region's.
        max_distance: m, of a surfel from its plane.
        min_surfels: a plane of fewer is dropped.
        min_cells: a piece of fewer 5 cm cells is dropped.
        iterations: RANSAC samples per plane.
    """

    labels: tuple[Label, ...] = (
        Label.WALL,
        Label.TERRAIN,
        Label.INCLINED_RAMP,
        Label.STRAIGHT_RAMP,
        Label.CEILING,
    )
    block: int = 8
    min_pixels: int = 16
    max_residual: float = 0.005
    max_step: float = 0.12
    max_angle: float = np.deg2rad(20)
    max_distance: float = 0.025
    min_surfels: int = 10
    min_cells: int = 8
    iterations: int = 50


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
    """
    config = config or PlanesConfig()
    surfels = _thin(frame, labels, config)
    region = _grow(surfels, config)
    region, planes = _ransac_all(surfels, region, seed, config)
    region, planes = _settle(surfels, region, planes, config)
    return list(_patches(frame, surfels, region, planes, T_map_camera, config))


def _thin(frame: Frame, labels: NDArray[np.uint8], config: PlanesConfig) -> _Surfels:
    """Average away the noise and most of the points, the boundaries between labels kept."""
    image = np.zeros(frame.depth.shape, np.uint8)
    image[frame.returns] = np.where(np.isin(labels, config.labels), labels, 0)
    points, surfel_labels, blocks, of_pixel = make_surfels(
        frame.depth, image, frame.intrinsics.rays, config.block, config.min_pixels, config.max_residual
    )
    near = neighbours(blocks, image.shape[1] // config.block + 1, surfel_labels, points, 2, config.max_step)
    return _Surfels(points, surfel_labels, near, of_pixel)


def _grow(surfels: _Surfels, config: PlanesConfig) -> NDArray[np.int32]:
    """(N,) region of every surfel, grown from the flattest places first."""
    normal, variation = normals(surfels.points, surfels.near)
    return grow_regions(
        surfels.points, surfels.near, normal, np.argsort(variation, kind="stable"),
        np.cos(config.max_angle), config.max_distance,
    )  # fmt: skip


def _ransac_all(
    surfels: _Surfels, region: NDArray[np.int32], seed: int, config: PlanesConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(N,) plane of every surfel, NONE for outliers, and the (P, 4) planes [n, d] of all regions.

    Large regions come first and keep what lies on their planes: the surfels along the line where two walls meet
    are between both, and would pass for a narrow plane of their own.
    """
    o3d.utility.random.seed(seed)
    result = np.full(len(region), NONE, np.int32)
    planes = np.empty((0, 4))
    for members in sorted(_groups(region, config.min_surfels), key=len, reverse=True):
        claimed = claim_nearest(surfels.points, surfels.near, members, result, planes, config.max_distance)
        result[members] = claimed
        members = members[claimed == NONE]
        while len(members) >= config.min_surfels:
            inlier = _ransac(surfels.points[members], config)
            if inlier.sum() < config.min_surfels:
                break
            result[members[inlier]] = len(planes)
            planes = np.vstack([planes, _fit(surfels.points[members[inlier]])])
            members = members[~inlier]
    return result, planes


def _ransac(points: NDArray[np.float32], config: PlanesConfig) -> NDArray[np.bool_]:
    """(N,) bool, the points near the best of the sampled planes.

    With probability 1 Open3D tries all samples. With less it stops early, sooner or later by the timing of its
    threads, and the result varies with it.
    """
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
    (*normal, d), _ = cloud.segment_plane(config.max_distance, 3, config.iterations, probability=1.0)
    return np.abs(points @ np.array(normal) + d) < config.max_distance


def _settle(
    surfels: _Surfels, region: NDArray[np.int32], planes: NDArray[np.float64], config: PlanesConfig
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Let every surfel choose the nearest plane around it, and fit again, so that edges fall where planes meet."""
    everyone = np.arange(len(region))
    for _ in range(2):
        region = claim_nearest(
            surfels.points, surfels.near, everyone, region, planes, config.max_distance
        )
        planes = planes.copy()
        for members in _groups(region, config.min_surfels):
            planes[region[members[0]]] = _fit(surfels.points[members])
    return region, planes


def _patches(
    frame: Frame,
    surfels: _Surfels,
    region: NDArray[np.int32],
    planes: NDArray[np.float64],
    T_map_camera: NDArray[np.float64],
    config: PlanesConfig,
) -> Iterator[PlanePatch]:
    """The connected pieces of every plane."""
    points, of_point = project_pixels(
        frame.depth, frame.intrinsics.rays, surfels.of_pixel, region, planes, 2, 0.1
    )
    points = transform_points(T_map_camera, points)
    centres = transform_points(T_map_camera, surfels.points)
    for pixels in _groups(region[of_point], 1):
        cells, row = cells_of(points[pixels])
        piece = connected_pieces(cells)
        for piece_pixels in _groups(piece[row], 1):
            inside = cells[piece == piece[row[piece_pixels[0]]]]
            members = np.unique(of_point[pixels[piece_pixels]])
            if len(members) >= config.min_surfels and len(inside) >= config.min_cells:
                moments = Moments.of(centres[members])
                plane = moments.fit()[0].facing(T_map_camera[:3, 3] - moments.centroid)
                label = Label(surfels.labels[members[0]])
                yield PlanePatch(label, plane, moments, points[pixels[piece_pixels]], inside)


def _groups(region: NDArray, min_size: int) -> Iterator[NDArray[np.intp]]:
    """The members of every region of at least that size, in the order of the regions."""
    order = np.argsort(region, kind="stable")
    starts = np.flatnonzero(np.diff(region[order], prepend=NONE))
    for members in np.split(order, starts)[1:]:
        if len(members) >= min_size:
            yield members


def _fit(points: NDArray) -> NDArray[np.float64]:
    """(4,) least-squares plane [n, d]."""
    plane, _ = Moments.of(points).fit()
    return np.append(plane.normal, plane.offset)
