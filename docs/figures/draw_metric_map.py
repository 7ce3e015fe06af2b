"""Draw docs/images/metric-map.jpg: the occupied voxels coloured by class, after 35, 70, 105 and 140 keyframes."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.explorer import Explorer
from pipeline.labels import COLOURS
from pipeline.mapper import Keyframe, Mapper
from pipeline.metric_map.io.octomap import voxel_labels
from pipeline.metric_map.metric_map import MetricMap
from pipeline.run import explore
from pipeline.sink import Sink
from sarsim.arenas.load import load_arena
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

KEYFRAMES = (35, 70, 105, 140)
ELEVATION, AZIMUTH = np.radians(52), np.radians(-75)
PIXELS_PER_METRE = 112
SIZE = (800, 560)  # width, height of a panel
BRIGHTNESS = (0.62, 0.8, 1.0)  # of faces with normals along x, y and z


class Panels(Sink):
    """Draws the robot's map after each of ``KEYFRAMES``."""

    def __init__(self, mapper: Mapper):
        self._mapper, self.panels = mapper, list[NDArray[np.uint8]]()

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Draw a panel if one is due."""
        count = len(self._mapper.keyframes)
        if count not in KEYFRAMES:
            return
        semantic_map, metric_map = self._mapper.semantic_map, self._mapper.metric_map
        picture = draw(metric_map, voxel_labels(metric_map, semantic_map.points(), semantic_map.labels()))
        at, text = (20, SIZE[1] - 20), f"{count} keyframes"
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 1.0, (60, 60, 60), 2, cv2.LINE_AA)
        self.panels.append(picture)


def draw(metric_map: MetricMap, labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The occupied voxels as cubes in the colours of their (N,) labels, drawn from back to front."""
    picture = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
    centres, side = metric_map.occupied_centres(), metric_map.voxel_size
    colours = COLOURS[labels][:, ::-1]
    toward = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
    for n in np.argsort(centres @ toward):
        draw_cube(picture, centres[n], side, colours[n], np.sign(toward))
    return picture


def draw_cube(
    picture: NDArray[np.uint8], centre: NDArray, side: float, colour: NDArray[np.uint8], toward: NDArray
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


def to_pixels(points: NDArray) -> NDArray[np.int32]:
    """(N, 2) pixels of (N, 3) points, in orthographic projection."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0])
    up = np.array([-np.sin(ELEVATION) * np.cos(AZIMUTH), -np.sin(ELEVATION) * np.sin(AZIMUTH), np.cos(ELEVATION)])
    x, y = (points - [0, 0, 0.3]) @ right, (points - [0, 0, 0.3]) @ up
    centred = np.column_stack([x, -y]) * PIXELS_PER_METRE
    return np.rint(centred + np.array(SIZE) / 2).astype(np.int32)


def main() -> None:
    """Explore and draw."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    mapper = make_mapper(TRUE_LABELS, robot.model)
    explorer, maps = Explorer(robot, mapper), Panels(mapper)
    explorer.watch(maps)
    explore(explorer, may_step=lambda: len(maps.panels) < len(KEYFRAMES))
    robot.close()
    rows = [np.hstack(maps.panels[:2]), np.hstack(maps.panels[2:])]
    path = Path(__file__).parents[1] / "images" / "metric-map.jpg"
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main()
