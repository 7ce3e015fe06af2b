"""Draw the pictures of lighting.md: ``python docs/figures/draw_lighting.py``."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sarsim.arenas.load import load_arena
from sarsim.dataset.summary import depth_picture
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

IMAGES = Path(__file__).parents[1] / "images"
PLACES = [(-2.2, 1.2, 0.3), (2.6, 0.5, -1.5)]
"""x, y in m and yaw in rad in ``nist_6x4``: in front of the lying child, in front of the sitting woman."""
CONDITIONS = {
    "normal": SimulationConfig(),
    "dim": SimulationConfig(lighting="dim"),
    "dark": SimulationConfig(lighting="dark"),
    "normal, dust 0.3": SimulationConfig(dust=0.3),
    "dark, dust 0.3": SimulationConfig(lighting="dark", dust=0.3),
    "normal, dust 1": SimulationConfig(dust=1),
}

GRAIN = (slice(60, 380), slice(1480, 1800))
"""Rows and columns of a row of images that show the woman at full size."""


def main() -> None:
    rows = [row_of(title, config) for title, config in CONDITIONS.items()]
    save("lighting.jpg", cv2.resize(np.vstack(rows), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    save("lighting-grain.jpg", np.hstack([row[GRAIN] for row in rows[:3]]))


def save(name: str, picture: NDArray[np.uint8]) -> None:
    cv2.imwrite(str(IMAGES / name), picture, [cv2.IMWRITE_JPEG_QUALITY, 85])


def row_of(title: str, config: SimulationConfig) -> NDArray[np.uint8]:
    """Colour and depth images at each pose, side by side, (H, W, 3) BGR."""
    robot = SimulatedRobot(load_arena("nist_6x4"), config, seed=0)
    pictures = []
    for x, y, yaw in PLACES:
        robot.robot.set_pose(robot.physics, (x, y, 0), (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
        robot.physics.forward()
        frame = robot.sense()
        pictures += [frame.rgb[..., ::-1].copy(), depth_picture(frame.depth)[..., ::-1]]
    robot.close()
    cv2.putText(pictures[0], title, (12, 34), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 2, cv2.LINE_AA)
    return np.hstack(pictures)


if __name__ == "__main__":
    main()
