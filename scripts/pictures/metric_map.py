"""Draw the picture for metric-map.md: a run's occupied voxels, in the colours of their classes, as the map grows."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Rgb
from pipeline.labels import COLOURS
from pipeline.lettering import write
from pipeline.metric_map.io.octomap import voxel_labels
from pipeline.metric_map.metric_map import MetricMap
from sarsim.composition import make_mapper
from sarsim.robots.model import robot_model
from sarsim.settings import PerceptionConfig
from scripts.pictures.layout import INK, beside, blank, save, stacked

FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""Fractions of the keyframes after which the map is drawn."""
ELEVATION, AZIMUTH = np.radians(52), np.radians(-75)
PIXELS_PER_METRE = 112
SIZE = (800, 560)
"""Width and height of a panel, pixels."""
BRIGHTNESS = (0.62, 0.8, 1.0)
"""Brightness of faces with normals along x, y and z."""


def draw(folder: Path) -> None:
    """Draw the map of the run in a folder with the labels at the end of the run."""
    mapper = make_mapper(PerceptionConfig(detector=None), robot_model(), earlier=folder)
    keyframes, semantic_map, metric_map = mapper.keyframes, mapper.semantic_map, MetricMap()
    points, labels = semantic_map.points(), semantic_map.labels()
    due, panels = [round(share * len(keyframes)) for share in FRACTIONS], []
    for count, (seen, T_map_base) in enumerate(zip(keyframes.observations, keyframes.poses, strict=True), 1):
        seen.add_to_metric_map(metric_map, T_map_base)
        if count in due:
            picture = voxel_picture(metric_map, voxel_labels(metric_map, points, labels))
            write(picture, (20, SIZE[1] - 20), f"{count} keyframes", 30, INK)
            panels.append(picture)
    save("metric-map.jpg", stacked(beside(*panels[:2], gap=0), beside(*panels[2:], gap=0), gap=0), 78)


def voxel_picture(metric_map: MetricMap, labels: Labels) -> Rgb:
    """The occupied voxels as cubes in the colours of their (N,) labels, drawn from back to front."""
    picture = blank(*SIZE)
    centres, side = metric_map.occupied_centres(), metric_map.voxel_size
    toward = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
    for n in np.argsort(centres @ toward):
        draw_cube(picture, centres[n], side, COLOURS[labels[n]], np.sign(toward))
    return picture


def draw_cube(
    picture: Rgb, centre: NDArray[np.floating], side: float, colour: NDArray[np.uint8], toward: NDArray[np.floating]
) -> None:
    """Draw the three faces of a cube that face the viewer."""
    for axis in range(3):
        corners = np.tile(centre + 0.5 * side * toward * np.eye(3)[axis], (4, 1))
        others = [other for other in range(3) if other != axis]
        corners[:, others] += 0.5 * side * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        face = to_pixels(corners)
        shade = colour * BRIGHTNESS[axis]
        cv2.fillConvexPoly(picture, face, shade.tolist(), cv2.LINE_AA)
        cv2.polylines(picture, [face], True, (shade * 0.7).tolist(), 1, cv2.LINE_AA)


def to_pixels(points: NDArray[np.floating]) -> NDArray[np.int32]:
    """(N, 2) pixels of (N, 3) points, in orthographic projection."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0])
    up = np.array([-np.sin(ELEVATION) * np.cos(AZIMUTH), -np.sin(ELEVATION) * np.sin(AZIMUTH), np.cos(ELEVATION)])
    x, y = (points - [0, 0, 0.3]) @ right, (points - [0, 0, 0.3]) @ up
    centred = np.column_stack([x, -y]) * PIXELS_PER_METRE
    return np.rint(centred + np.array(SIZE) / 2).astype(np.int32)
