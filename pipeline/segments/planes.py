"""Planes in one look: region growing and RANSAC (thesis 3.2, figures 4 and 5).

A plane whose surface has a gap is parted there by growing again, over the cells that it fills.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.segments.cells import Cells, cells_of, connected_pieces
from pipeline.segments.planar_regions import RegionsConfig, groups, planar_regions
from pipeline.segments.plane import Moments, Plane
from pipeline.segments.surfels_kernels import project_pixels
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
    regions: RegionsConfig = field(default_factory=RegionsConfig)
    """How they are found."""
    stride: int = 2
    """Every how many pixels the plane's extent is looked up."""
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
    found = planar_regions(frame, _label_image(frame, labels, config), seed, config.regions)
    surfels, region = found.surfels, found.region
    points, plane_of_point, surfel = project_pixels(
        frame.depth, frame.intrinsics.rays, T_map_camera, surfels.of_pixel, surfels.near, region, found.planes,
        config.stride, config.regions.max_shift, config.regions.noise,
    )  # fmt: skip
    centres = transform_points(T_map_camera, surfels.points)
    patches = []
    for number, members in groups(plane_of_point):
        for inside, cells in _pieces(points[members]):
            # A pixel at an edge may lie on this plane though its surfel, a mean, was given to another one.
            own = np.unique(surfel[members[inside]])
            own = own[region[own] == number]
            if len(own) >= config.regions.min_surfels and len(cells) >= config.min_cells:
                label = Label(surfels.labels[own[0]])
                patches.append(
                    _patch(label, centres[own], points[members[inside]], cells, T_map_camera[:3, 3])
                )
    return patches


def _label_image(frame: Frame, labels: NDArray[np.uint8], config: PlanesConfig) -> NDArray[np.uint8]:
    """(H, W) uint8 labels of the pixels of classes made of planes, 0 elsewhere."""
    if labels.shape != (np.count_nonzero(frame.returns),):
        raise InputError(f"planes: {labels.shape} labels for {np.count_nonzero(frame.returns)} returns")
    image = np.zeros(frame.depth.shape, np.uint8)
    image[frame.returns] = np.where(np.isin(labels, config.labels), labels, Label.UNLABELLED)
    return image


def _pieces(points: NDArray[np.float32]) -> Iterator[tuple[NDArray[np.intp], Cells]]:
    """The connected pieces of (N, 3) points: which points and which cells."""
    cells, row = cells_of(points)
    piece = connected_pieces(cells, np.bincount(row))
    for number, inside in groups(piece[row]):
        yield inside, cells[piece == number]


def _patch(
    label: Label, surfels: NDArray, points: NDArray[np.float32], cells: Cells, viewpoint: NDArray[np.float64]
) -> PlanePatch:
    moments = Moments.of(surfels)
    plane, _ = moments.fit()
    return PlanePatch(label, plane.facing(viewpoint - moments.centroid), moments, points, cells)
