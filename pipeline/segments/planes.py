"""Planes in one frame: region growing and RANSAC (thesis 3.2, figures 4 and 5).

A plane whose surface has a gap is split there by a second region growing, over the cells that it fills.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.geometry.cells import FRONT, Cells, cells_of, connected_pieces
from pipeline.labels import PLANAR, Label
from pipeline.segments.planar_regions import MIN_SURFELS, groups, planar_regions
from pipeline.segments.plane import Moments, Plane
from pipeline.segments.surfels_kernels import project_pixels
from pipeline.transforms import transform_points

REGION_ANGLE = np.deg2rad(20)  # rad, between a surfel's normal and its region's
PIXEL_SHIFT = 0.01  # m along the optical axis from a pixel of the plane to the point where its ray meets the plane
PIXEL_NOISE = 0.006
"""m per m² of depth that is added to ``PIXEL_SHIFT``: 3σ of a structured-light camera (Nguyen et al. 2012)."""
PIXEL_STEP = 2  # pixels, between the pixels that give the plane's extent


@dataclass(frozen=True, eq=False)
class PlanePatch:
    """A connected piece of plane in one frame, in ``map``.

    Attributes:
        label: its class.
        plane: least-squares plane.
        moments: of its surfels.
        points: (N, 3) float32, the points where the rays of its pixels meet the plane.
        cells: (K, 3) int32 cells of the map that contain these points.
    """

    label: Label
    plane: Plane
    moments: Moments
    points: NDArray[np.float32]
    cells: Cells


def find_planes(
    frame: Frame, labels: NDArray[np.uint8], T_map_camera: NDArray[np.float64], seed: int
) -> list[PlanePatch]:
    """The planes of one frame.

    Args:
        frame: one frame.
        labels: (N,) uint8 class of every return, row-major.
        T_map_camera: 4×4 pose of the camera.
        seed: of RANSAC; the same seed and frame give the same planes, bit for bit.

    Raises:
        InputError: if the number of labels is not that of the returns.
    """
    found = planar_regions(frame, _label_image(frame, labels), seed, REGION_ANGLE)
    surfels, region = found.surfels, found.region
    points, plane_of_point, surfel = project_pixels(
        frame.depth, frame.intrinsics.rays, T_map_camera, surfels.of_pixel, surfels.near, region, found.planes,
        PIXEL_STEP, PIXEL_SHIFT, PIXEL_NOISE,
    )  # fmt: skip
    centres = transform_points(T_map_camera, surfels.points)
    patches = []
    for number, members in groups(plane_of_point):
        for inside, cells in _pieces(points[members]):
            # A pixel at an edge may lie on this plane although its surfel, a mean, belongs to another plane.
            own = np.unique(surfel[members[inside]])
            own = own[region[own] == number]
            if len(own) >= MIN_SURFELS and len(cells) >= FRONT:
                moments = Moments.of(centres[own])
                plane, _ = moments.fit(T_map_camera[:3, 3] - moments.centroid)
                label = Label(surfels.labels[own[0]])
                patches.append(PlanePatch(label, plane, moments, points[members[inside]], cells))
    return patches


def _label_image(frame: Frame, labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W) uint8 label of every pixel of a planar class, 0 elsewhere."""
    if labels.shape != (np.count_nonzero(frame.returns),):
        raise InputError(f"planes: {labels.shape} labels for {np.count_nonzero(frame.returns)} returns")
    image = np.zeros(frame.depth.shape, np.uint8)
    image[frame.returns] = np.where(np.isin(labels, PLANAR), labels, Label.UNLABELLED)
    return image


def _pieces(points: NDArray[np.float32]) -> Iterator[tuple[NDArray[np.intp], Cells]]:
    """The connected pieces of (N, 3) points: the indices of each piece's points, and its cells."""
    cells, row = cells_of(points)
    piece = connected_pieces(cells, np.bincount(row))
    for number, inside in groups(piece[row]):
        yield inside, cells[piece == number]
