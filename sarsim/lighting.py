"""How bright the arena is."""

from enum import Enum

import numpy as np
from dm_control import mjcf

from sarsim.pioneer3at import Pioneer3AT


class Lighting(Enum):
    """The share of the arena's own light that is left, and whether the robot's lamp is on."""

    normal = (1.0, False)
    dim = (0.2, False)
    dark = (0.0, True)


def set_lighting(physics: mjcf.Physics, robot: Pioneer3AT, lighting: Lighting) -> None:
    """Dim the arena's lights and the headlight, and switch the robot's lamp."""
    share, lamp_on = lighting.value
    model = physics.model
    lamp = physics.bind(robot.lamp).element_id
    arena_lights = np.arange(model.nlight) != lamp
    for colours in (model.light_ambient, model.light_diffuse, model.light_specular):
        colours[arena_lights] *= share
    headlight = model.vis.headlight
    for colours in (headlight.ambient, headlight.diffuse, headlight.specular):
        colours *= share
    model.light_active[lamp] = lamp_on
