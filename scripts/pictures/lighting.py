"""Draw the pictures for lighting.md."""

import numpy as np

from pipeline.arrays import Rgb
from sarsim.arenas.load import load_arena
from sarsim.dataset.summary import depth_picture
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import beside, captioned, save, scaled, stacked

POSES = [(-2.2, 1.2, 0.3), (2.6, 0.5, -1.5)]
"""x, y in m and yaw in rad in ``nist_6x4``: in front of the lying child, in front of the sitting woman."""
CONDITIONS = {
    "normal": SimulationConfig(),
    "dim": SimulationConfig(lighting="dim"),
    "dark": SimulationConfig(lighting="dark"),
    "normal, dust 0.3": SimulationConfig(dust=0.3),
    "dark, dust 0.3": SimulationConfig(lighting="dark", dust=0.3),
    "normal, dust 1": SimulationConfig(dust=1),
}

DETAIL = (slice(60, 380), slice(1480, 1800))
"""Rows and columns of the part of each row of images that shows the woman and is drawn at full size."""


def draw() -> None:
    """Draw the images under each condition, and details that show their noise."""
    rows = [row_of(config) for config in CONDITIONS.values()]
    titled = (captioned(scaled(row, 0.5), title) for row, title in zip(rows, CONDITIONS, strict=True))
    save("lighting.jpg", stacked(*titled, gap=4), 82)
    save("lighting-grain.jpg", beside(*(row[DETAIL] for row in rows[:3])))


def row_of(config: SimulationConfig) -> Rgb:
    """Colour and depth images at each pose, side by side."""
    robot = SimulatedRobot(load_arena("nist_6x4"), config, seed=0)
    pictures = []
    for x, y, yaw in POSES:
        robot.robot.set_pose(robot.physics, (x, y, 0), (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
        robot.physics.forward()
        frame = robot.sense()
        pictures += [frame.rgb, depth_picture(frame.depth)]
    robot.close()
    return np.hstack(pictures)
