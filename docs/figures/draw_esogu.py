"""Draw the pictures of esogu.md: ``python docs/figures/draw_esogu.py``."""

from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS, Label
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.sensors.camera import RgbdCamera, geom_labels
from sarsim.sensors.rendering import Renderer
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

IMAGES = Path(__file__).parents[1] / "images"
HIDDEN = 3
"""A geom group that is not drawn."""
PLACES = [
    (-25.0, 0.7, 0.0), (5.0, 1.1, -0.12), (-19.9, -5.8, 2.9), (-1.2, -2.3, -2.3),
    (6.2, -5.3, 0.2), (-10.9, 5.1, -0.25), (12.8, 3.0, 1.7), (-2.2, 2.8, 0.8),
]  # fmt: skip
"""x, y in m and yaw in rad."""


def main() -> None:
    """Draw the floor from above and from the side, and images of the robot's camera on it."""
    for camera in ("overview", "top"):
        save(f"esogu-{camera}.jpg", cropped(from_above(camera)))
    save("esogu-robot.jpg", robots_eye(PLACES, SimulationConfig()))
    save("esogu-dark.jpg", robots_eye(PLACES[:4], SimulationConfig(lighting="dark")))


def save(name: str, picture: NDArray[np.uint8]) -> None:
    cv2.imwrite(str(IMAGES / name), picture, [cv2.IMWRITE_JPEG_QUALITY, 82])


def from_above(camera: str) -> NDArray[np.uint8]:
    """The floor without its ceiling, BGR; rendered at twice the size, for smooth edges."""
    model = mujoco.MjModel.from_xml_path(str(asset("arenas", "esogu_52x15.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    model.geom_group[geom_labels(model) == Label.CEILING] = HIDDEN
    with Renderer(model, 3200, 2400) as renderer:
        picture = renderer.colour(data, camera)
    halved = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return halved[..., ::-1].astype(np.uint8)


def cropped(picture: NDArray[np.uint8], margin: int = 12) -> NDArray[np.uint8]:
    """The image cropped to its content, with the empty background in white."""
    drawn = picture.max(axis=2) > 0
    picture = np.where(drawn[..., None], picture, np.uint8(255))
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    return picture[rows[0] - margin : rows[-1] + margin, max(0, columns[0] - margin) : columns[-1] + margin]


def robots_eye(places: list[tuple[float, float, float]], config: SimulationConfig) -> NDArray[np.uint8]:
    """(H, W, 3) BGR images of the robot's camera, with labels below, four positions in a row."""
    robot = SimulatedRobot(load_arena("esogu_52x15"), config, seed=0)
    camera = RgbdCamera(robot.renderer, robot.robot.camera.full_identifier)
    pictures = []
    for x, y, yaw in places:
        robot.robot.set_pose(robot.physics, (x, y, 0), (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
        robot.physics.forward()
        label = camera.capture(robot.physics.data.ptr).label
        small = [
            cv2.resize(p[..., ::-1], (400, 300), interpolation=cv2.INTER_AREA)
            for p in (robot.sense().rgb, COLOURS[label])
        ]
        pictures.append(np.vstack(small))
    robot.close()
    return np.vstack([np.hstack(pictures[n : n + 4]) for n in range(0, len(pictures), 4)])


if __name__ == "__main__":
    main()
