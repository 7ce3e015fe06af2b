"""Planes in one frame: region growing and RANSAC (thesis 3.2, figures 4 and 5).

A second region growing, over the cells that the surface on a plane fills, splits the plane at gaps in the surface.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Labels, Points, Pose
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.geometry.cells import MIN_FRONT_CELLS, SurfaceCells, cells_of, connected_pieces
from pipeline.geometry.planes import Moments, Plane
from pipeline.labels import PLANAR, Label
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.planar_regions import MIN_SURFELS, groups, planar_regions
from pipeline.segments.surfels_kernels import project_pixels
from pipeline.transforms import transform_points

STRIDE = 2
"""Step between the pixels that determine the extent of a plane, along rows and columns."""
SHIFT, NOISE = 0.01, 0.006
"""Terms of the limit ``SHIFT + NOISE · depth²``, m, below which the depth of a pixel may change; m and 1/m.

Pixels are moved onto planes along their rays. ``NOISE`` is 3σ of a structured-light camera (Nguyen et al. 2012).
"""


@dataclass(frozen=True, eq=False)
class PlanePatch:
    """A connected piece of a plane in one frame, expressed in ``map``.

    Attributes:
        label: class of the surface.
        plane: least-squares plane.
        moments: moments of the patch's surfels.
        points: points where the rays of the patch's pixels meet the plane.
        cells: cells of the map that contain these points.
    """

    label: Label
    plane: Plane
    moments: Moments
    points: Points
    cells: SurfaceCells


def find_planes(
    frame: Frame, labels: Labels, T_map_camera: Pose, seed: int, config: SegmentsConfig
) -> list[PlanePatch]:
    """Find the connected pieces of planes in one frame.

    Args:
        frame: the frame.
        labels: class of every return, row-major.
        T_map_camera: pose of the camera.
        seed: seed of RANSAC; the same seed and frame give the same planes, bit for bit.
        config: parameters of the segments.

    Raises:
        InputError: the number of labels differs from the number of returns.
    """
    found = planar_regions(frame, _label_image(frame, labels), seed, config.angle)
    surfels, region = found.surfels, found.plane_of_surfel
    points, plane_of_point, surfel = project_pixels(
        frame.depth, frame.intrinsics.rays, T_map_camera, surfels.of_pixel, surfels.neighbours, region, found.planes,
        STRIDE, SHIFT, NOISE,
    )  # fmt: skip
    centres = transform_points(T_map_camera, surfels.points)
    patches = []
    for number, members in groups(plane_of_point):
        for inside, cells in _pieces(points[members], config.cell):
            # A pixel at an edge may lie on this plane although its surfel, a mean of pixels, lies on another plane.
            own = np.unique(surfel[members[inside]])
            own = own[region[own] == number]
            if len(own) >= MIN_SURFELS and len(cells) >= MIN_FRONT_CELLS:
                moments = Moments.of(centres[own])
                plane, _ = moments.fit(T_map_camera[:3, 3] - moments.centroid)
                label = Label(surfels.labels[own[0]])
                patches.append(PlanePatch(label, plane, moments, points[members[inside]], cells))
    return patches


def _label_image(frame: Frame, labels: Labels) -> NDArray[np.uint8]:
    """(H, W) uint8 label of every pixel with a planar class, 0 elsewhere."""
    wanted = (int(np.count_nonzero(frame.returns)),)
    if labels.shape != wanted:
        raise InputError(f"planes: labels must have shape {wanted}, one for each return, not {labels.shape}")
    image = np.zeros(frame.depth.shape, np.uint8)
    image[frame.returns] = np.where(np.isin(labels, PLANAR), labels, Label.UNLABELLED)
    return image


def _pieces(points: Points, edge: float) -> Iterator[tuple[Indices, SurfaceCells]]:
    """Split points into pieces whose cells, ``edge`` m wide, are connected; yield each piece's indices and cells."""
    cells, row = cells_of(points, edge)
    piece = connected_pieces(cells, np.bincount(row))
    for number, inside in groups(piece[row]):
        yield inside, cells[piece == number]
