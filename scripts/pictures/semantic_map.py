"""Draw the picture for semantic-map.md: the labelled points and the segments' boxes of a run's map, from above."""

from itertools import product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Rgb
from pipeline.labels import COLOURS, THESIS_FOUR, Label
from pipeline.segments.boxes import corners
from pipeline.segments.segments import Segments
from sarsim.composition import make_mapper
from sarsim.robots.model import robot_model
from sarsim.settings import PerceptionConfig
from scripts.pictures.layout import DIM_INK, beside, blank, legend, save, scaled, stacked

PIXELS_PER_METRE = 180
MARGIN = 0.1
"""Margin around the map, m."""


class View:
    """A view of points from straight above."""

    def __init__(self, points: NDArray[np.floating]):
        self._low, high = np.quantile(points[:, :2], (0.0005, 0.9995), axis=0) + np.array([[-MARGIN], [MARGIN]])
        self.size = tuple(((high - self._low) * PIXELS_PER_METRE).astype(int).tolist())

    def pixels(self, points: NDArray[np.floating]) -> NDArray[np.int32]:
        """(N, 2) pixels of (N, 3) points in ``map``, m."""
        x, y = ((points[:, :2] - self._low) * PIXELS_PER_METRE).T
        return np.column_stack([x, self.size[1] - y]).astype(np.int32)


def draw(folder: Path) -> None:
    """Draw the map of the run in a folder."""
    mapper = make_mapper(PerceptionConfig(detector=None), robot_model(), earlier=folder)
    points, labels = mapper.semantic_map.points(), mapper.semantic_map.labels()
    view = View(points)
    maps = beside(points_picture(view, points, labels), segments_picture(view, mapper.segments), gap=16)
    named = legend([*THESIS_FOUR, Label.VICTIM, Label.CLUTTER], maps.shape[1], size=28)
    save("semantic-map.jpg", scaled(stacked(maps, named, gap=0), 0.65))


def points_picture(view: View, points: NDArray[np.float32], labels: Labels) -> Rgb:
    """All labelled points, except points of the ceiling, in the colours of their labels, the highest on top."""
    picture = blank(*view.size)
    order = np.argsort(points[:, 2])
    order = order[~np.isin(labels[order], (Label.CEILING, Label.UNLABELLED))]
    for shift in product((-1, 0, 1, 2), repeat=2):
        x, y = (view.pixels(points[order]) + shift).clip(0, np.array(view.size) - 1).T
        picture[y, x] = COLOURS[labels[order]]
    return picture


def segments_picture(view: View, segments: Segments) -> Rgb:
    """The outline of every segment's box, with an arrow along the segment's normal."""
    picture = blank(*view.size)
    for segment in sorted(segments, key=lambda s: s.box.T_map_box[2, 3]):
        outline, colour = cv2.convexHull(view.pixels(corners(segment.box))), COLOURS[segment.label]
        cv2.fillPoly(picture, [outline], (colour * 0.6).tolist(), cv2.LINE_AA)
        cv2.polylines(picture, [outline], True, colour.tolist(), 4, cv2.LINE_AA)
    for segment in segments:
        middle = segment.box.T_map_box[:3, 3]
        a, b = view.pixels(np.stack([middle, middle + 0.15 * segment.plane.normal])).tolist()
        cv2.arrowedLine(picture, a, b, DIM_INK, 3, cv2.LINE_AA, tipLength=0.35)
    return picture
