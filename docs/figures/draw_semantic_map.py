"""Draw docs/images/semantic-map.jpg: points and segments from frames all over the NIST arena, seen from above."""

from itertools import product
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS
from pipeline.robot import Velocity
from pipeline.segments.boxes import corners
from pipeline.segments.planes import find_planes
from pipeline.segments.segments import Segments
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.arenas.load import load_arena
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

PLACES = [(-2.4, -1.35), (1.2, -1.4), (1.8, -1.6), (2.4, -0.1), (-2.4, -0.1), (-2.3, 1.2), (0.0, 1.2)]
YAWS = np.arange(0, 2 * np.pi, np.pi / 3)
PIXELS_PER_METRE = 160
BGR = COLOURS[:, ::-1]


def to_pixels(points: NDArray) -> NDArray[np.int32]:
    """(N, 2) pixels of (N, 3) points of the arena, seen from above."""
    return (np.column_stack([points[:, 0] + 3.1, 2.1 - points[:, 1]]) * PIXELS_PER_METRE).astype(np.int32)


def blank() -> NDArray[np.uint8]:
    """A white image of the arena's size."""
    return np.full((int(4.2 * PIXELS_PER_METRE), int(6.2 * PIXELS_PER_METRE), 3), 255, np.uint8)


def points_picture(semantic_map: SemanticMap) -> NDArray[np.uint8]:
    """Every point in the colour of its label, the highest on top."""
    picture, points = blank(), semantic_map.points()
    order = np.argsort(points[:, 2])
    x, y = to_pixels(points[order]).T
    for dx, dy in product((-1, 0, 1), repeat=2):
        picture[y + dy, x + dx] = BGR[semantic_map.labels()[order]]
    return picture


def segments_picture(segments: Segments) -> NDArray[np.uint8]:
    """The outline of every box with an arrow along its normal."""
    picture = blank()
    for segment in sorted(segments, key=lambda s: s.box.T_map_box[2, 3]):
        colour = BGR[segment.label].tolist()
        cv2.polylines(picture, [cv2.convexHull(to_pixels(corners(segment.box)))], True, colour, 3, cv2.LINE_AA)
        middle = segment.box.T_map_box[:3, 3]
        a, b = to_pixels(np.stack([middle, middle + 0.15 * segment.plane.normal])).tolist()
        cv2.arrowedLine(picture, a, b, (60, 60, 60), 2, cv2.LINE_AA, tipLength=0.3)
    return picture


def main() -> None:
    """Place the robot at several positions, take frames in all directions, and draw the map."""
    simulation = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(odometry="truth", sensor="xtion"), seed=0)
    classifier, semantic_map, segments = TruthClassifier(), SemanticMap(), Segments()
    for step, ((x, y), yaw) in enumerate(product(PLACES, YAWS)):
        simulation.robot.set_pose(simulation.physics, (x, y, 0.0), (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
        simulation.drive(Velocity())  # lets the robot settle, and updates its pose
        frame = simulation.sense()
        T_map_camera = frame.T_odom_base @ frame.T_base_camera
        points = frame.points(T_map_camera)
        probabilities = classifier.classify(frame, points, T_map_camera)
        semantic_map.update(points, probabilities)
        labels = probabilities.argmax(axis=1).astype(np.uint8)
        segments.update(find_planes(frame, labels, T_map_camera, step, segments.config), step, frame.T_odom_base)
    picture = np.hstack([points_picture(semantic_map), segments_picture(segments)])
    cv2.imwrite(
        str(Path(__file__).parents[1] / "images" / "semantic-map.jpg"),
        cv2.resize(picture, None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA),
    )


if __name__ == "__main__":
    main()
