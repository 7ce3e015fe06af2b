"""Draw docs/images/camera.jpg: the images of the robot's camera at one pose in the NIST arena."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS
from sarsim.arenas.load import load_arena
from sarsim.dataset.summary import depth_picture
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.xtion import Xtion
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

POSITION, YAW = (-1.55, 1.1, 0.0), np.radians(4)  # in the northern lane, in front of a victim, a ramp and a deck
ERROR = 0.04  # m, at either end of the colour scale of errors


def error_picture(error: NDArray[np.float32], returns: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """(H, W, 3) BGR image of errors (H, W) in m: blue too near, red too far, grey exact, black without return."""
    scaled = ((error / ERROR + 1) / 2 * 255).clip(0, 255).astype(np.uint8)
    side = np.abs(scaled.astype(np.float32) - 127.5)[..., None] / 127.5
    red_or_blue = np.where((scaled > 127)[..., None], (40, 40, 230), (230, 90, 40))
    return ((1 - side) * 225 + side * red_or_blue).astype(np.uint8) * returns[..., None]


def titled(picture: NDArray[np.uint8], title: str) -> NDArray[np.uint8]:
    """The image with a line of text above it."""
    bar = np.full((44, picture.shape[1], 3), 255, np.uint8)
    cv2.putText(bar, title, (8, 31), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (40, 40, 40), 2, cv2.LINE_AA)
    return np.vstack([bar, picture])


def main() -> None:
    """Place the robot, take a frame and draw it."""
    simulation = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(sensor="ideal"), seed=0)
    quaternion = (np.cos(YAW / 2), 0, 0, np.sin(YAW / 2))
    simulation.robot.set_pose(simulation.physics, POSITION, quaternion)
    simulation.physics.forward()
    ideal = RgbdCamera(simulation.renderer, simulation.robot.camera.full_identifier).capture(
        simulation.physics.data.ptr
    )
    noisy = Xtion().apply(ideal, np.random.default_rng(0))
    returns = noisy.depth > 0
    bgr = COLOURS[:, ::-1]
    rows = [
        [
            titled(ideal.rgb[..., ::-1], "colour"),
            titled(depth_picture(ideal.depth)[..., ::-1], "true depth"),
            titled(bgr[ideal.label], "label"),
        ],
        [
            titled(error_picture(noisy.depth - ideal.depth, returns), f"error, red and blue: {ERROR * 100:.0f} cm"),
            titled(depth_picture(noisy.depth)[..., ::-1], "depth of the Xtion"),
            titled(bgr[noisy.label] * returns[..., None], "labels of its points"),
        ],
    ]
    picture = np.vstack([np.hstack(row) for row in rows])
    cv2.imwrite(
        str(Path(__file__).parents[1] / "images" / "camera.jpg"),
        cv2.resize(picture, None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA),
    )


if __name__ == "__main__":
    main()
