"""Draw docs/images/lidar.jpg: a scan of the lidar in the NIST arena, from the lidar's position and from above."""

import cv2
import numpy as np

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS
from pipeline.transforms import inverse, transform_points
from sarsim.arenas.load import load_arena
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.lidar.scanner import Scan, Scanner
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import blank, save, stacked

POSITION, YAW = (-1.55, 1.1, 0.0), np.radians(4)  # in the northern lane, in front of a victim, a ramp and a deck
SENSOR = LidarConfig("64x1024", vertical=(-40, 10))
WIDTH, ROW_HEIGHT = 1024, 4  # Width of the picture, and height of each row of beams, pixels
MARGIN = 16  # Margin around the view from above, pixels
VIEWER_POSITION, VIEW_TARGET = (
    np.array([-1.6, -4.4, 8.0]),
    np.array([-0.6, 0.9, 0.3]),
)  # m, viewer's position and its target


def panorama(scan: Scan) -> Rgb:
    """The labels of the beams, with one row for each row of beams and left on the left; black without return."""
    rows, columns = len(SENSOR.model().elevations), SENSOR.model().columns
    picture = np.zeros((rows, columns, 3), np.uint8)
    shade = (0.35 + 0.65 * scan.intensity)[:, None]
    picture[rows - 1 - scan.ring, columns - 1 - scan.column] = COLOURS[scan.label] * shade
    return picture.repeat(ROW_HEIGHT, axis=0)


def from_above(scan: Scan) -> Rgb:
    """The points in the colours of their labels, seen from above the arena; nearer points hide farther points."""
    z = (VIEW_TARGET - VIEWER_POSITION) / np.linalg.norm(VIEW_TARGET - VIEWER_POSITION)
    x = np.cross(z, (0, 0, 1)) / np.linalg.norm(np.cross(z, (0, 0, 1)))
    T_world_eye = np.eye(4)
    T_world_eye[:3, :3], T_world_eye[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), VIEWER_POSITION
    points = transform_points(inverse(T_world_eye) @ scan.T_world_lidar, scan.points)
    seen = points[:, :2] / points[:, 2:]
    lowest, highest = np.quantile(seen, (0.001, 0.999), axis=0)
    scale = (WIDTH - 2 * MARGIN) / (highest - lowest)[0]
    pixels = np.rint((seen - lowest) * scale + MARGIN).astype(int)
    height = round(float((highest - lowest)[1] * scale)) + 2 * MARGIN
    picture = blank(WIDTH, height)
    for k in np.argsort(-points[:, 2]):
        colour = tuple(map(int, COLOURS[scan.label[k]]))
        cv2.circle(picture, pixels[k].tolist(), 1, colour, -1, cv2.LINE_AA)
    return picture


def draw() -> None:
    """Place the robot, scan and draw."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    robot.robot.set_pose(robot.physics, POSITION, (np.cos(YAW / 2), 0, 0, np.sin(YAW / 2)))
    robot.physics.forward()
    model, data = robot.physics.model.ptr, robot.physics.data.ptr
    scan = Scanner(model, data, robot.base_body, SENSOR.model(), np.random.default_rng(0)).scan(0.0)
    save("lidar.jpg", stacked(panorama(scan), from_above(scan), gap=12), 88)
    robot.close()
