"""Draw the pictures of the laboratory floor for arenas.md."""

import mujoco
import numpy as np

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS, Label
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.sensors.camera import RgbdCamera, geom_labels
from sarsim.sensors.rendering import Renderer
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import beside, on_background, save, scaled, stacked

HIDDEN_GROUP = 3
"""Geom group that is not drawn."""
POSES = [
    (-25.0, 0.7, 0.0), (5.0, 1.1, -0.12), (-19.9, -5.8, 2.9), (-1.2, -2.3, -2.3),
    (6.2, -5.3, 0.2), (-10.9, 5.1, -0.25), (12.8, 3.0, 1.7), (-2.2, 2.8, 0.8),
]  # fmt: skip
"""Poses of the robot, x and y in m and yaw in rad."""


def draw() -> None:
    """Draw the floor from above and from the side, and images from the robot's camera on the floor."""
    for camera in ("overview", "top"):
        save(f"esogu-{camera}.jpg", from_above(camera), 82)
    save("esogu-robot.jpg", robot_views(POSES, SimulationConfig()), 82)
    save("esogu-dark.jpg", robot_views(POSES[:4], SimulationConfig(lighting="dark")), 82)


def from_above(camera: str, margin: int = 12) -> Rgb:
    """The floor without its ceiling, cropped, and rendered at twice the size for smooth edges."""
    model = mujoco.MjModel.from_xml_path(str(asset("arenas", "esogu_52x15.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    model.geom_group[geom_labels(model) == Label.CEILING] = HIDDEN_GROUP
    with Renderer(model, 3200, 2400) as renderer:
        picture = renderer.colour(data, camera)
    drawn = np.asarray(picture[::2, ::2].any(axis=2))
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    across = slice(max(0, columns[0] - margin), columns[-1] + margin)
    return scaled(on_background(picture), 0.5)[rows[0] - margin : rows[-1] + margin, across]


def robot_views(places: list[tuple[float, float, float]], config: SimulationConfig) -> Rgb:
    """Images from the robot's camera, with labels below each image, for four positions in a row."""
    robot = SimulatedRobot(load_arena("esogu_52x15"), config, seed=0)
    camera = RgbdCamera(robot.renderer, robot.robot.camera.full_identifier)
    pictures = []
    for x, y, yaw in places:
        robot.robot.set_pose(robot.physics, (x, y, 0), (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
        robot.physics.forward()
        labels = COLOURS[camera.capture(robot.physics.data.ptr).label]
        pictures.append(np.vstack([scaled(robot.sense().rgb, 0.625), scaled(labels, 0.625)]))
    robot.close()
    return stacked(*(beside(*pictures[n : n + 4], gap=4) for n in range(0, len(pictures), 4)), gap=4)
