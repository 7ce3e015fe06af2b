"""Draw docs/images/camera.jpg: the images from the robot's camera at one pose in the NIST arena."""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS
from sarsim.arenas.load import load_arena
from sarsim.dataset.summary import depth_picture
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.xtion import Xtion
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import beside, save, scaled, stacked, titled

POSITION, YAW = (-1.55, 1.1, 0.0), np.radians(4)  # in the northern lane, in front of a victim, a ramp and a deck
MAX_ERROR = 0.04  # m, error at either end of the colour scale


def error_picture(error: NDArray[np.float32], returns: NDArray[np.bool_]) -> Rgb:
    """(H, W, 3) image of errors (H, W) in m: blue too near, red too far, grey exact, black without return."""
    scaled = ((error / MAX_ERROR + 1) / 2 * 255).clip(0, 255).astype(np.uint8)
    side = np.abs(scaled.astype(np.float32) - 127.5)[..., None] / 127.5
    red_or_blue = np.where((scaled > 127)[..., None], (230, 40, 40), (40, 90, 230))
    return ((1 - side) * 225 + side * red_or_blue).astype(np.uint8) * returns[..., None]


def draw() -> None:
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
    scale = f"depth error: red +{MAX_ERROR * 100:.0f} cm, blue −{MAX_ERROR * 100:.0f} cm"
    rows = [
        [("colour", ideal.rgb), ("true depth", depth_picture(ideal.depth)), ("label", COLOURS[ideal.label])],
        [
            (scale, error_picture(noisy.depth - ideal.depth, returns)),
            ("depth of the Xtion", depth_picture(noisy.depth)),
            ("labels of its points", COLOURS[noisy.label] * returns[..., None]),
        ],
    ]
    sheet = stacked(*(beside(*(titled(scaled(image, 0.7), title) for title, image in row)) for row in rows))
    save("camera.jpg", sheet)
    simulation.close()
