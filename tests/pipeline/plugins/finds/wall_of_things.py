"""A wall with things, rendered as the robot's camera sees it from 2.1 m."""

from collections.abc import Callable
from xml.etree.ElementTree import SubElement

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.things.models import ThingModel, door_lever, fire_extinguisher, qr_code
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.rendering import Renderer

ON_WALL = np.array([(1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0)])
THINGS: dict[str, tuple[Callable[[], ThingModel], tuple[float, float, float], NDArray[np.float64]]] = {
    "bottle": (lambda: fire_extinguisher("fire_extinguisher", 0.07, 0.42, 0, 0), (0.3, 0.48, 0.4), np.eye(3)),
    "lever": (lambda: door_lever("door_lever", 0.12, to_left=False), (-0.3, 0.59, 0.6), ON_WALL),
    "code": (lambda: qr_code("code_7", "wall 7", 0.14), (0.0, 0.589, 0.6), ON_WALL),
}


def wall_of(*names: str) -> Frame:
    """What the camera sees of these things and a block, with the depth sensor's errors."""
    builder = ArenaBuilder("things")
    builder.add_element("small_wall", (0, 0, 0), 0)
    builder.add_floor((-2, -2), (2, 2))
    for name in names:
        make, place, R = THINGS[name]
        builder.add_thing(make(), np.array(place), R)
    world = builder.root.find("worldbody")
    assert world is not None
    SubElement(world, "geom", name="block", type="box", size="0.1 0.05 0.1", pos="0 0.5 0.9", user="7")
    body = SubElement(world, "body", name="eye", pos="0 -1.51 0.6")
    SubElement(body, "camera", name="camera", xyaxes="1 0 0 0 0 1", fovy="45")
    model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Renderer(model, 640, 480) as renderer:
        image = RgbdCamera(renderer, "camera").capture(data)
    return Conditions().sense(image, np.random.default_rng(0)).frame(0.0, np.eye(4))
