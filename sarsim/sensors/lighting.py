"""How bright the arena is, and by what."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from sarsim.robots.skid_steered import SkidSteered
from sarsim.sensors.camera import LabelledImage

NEAREST = 0.15
"""m; the lamp lights nothing better than what is so near."""


@dataclass(frozen=True)
class Light:
    """What lights a scene.

    Attributes:
        arena: radiance of a white surface under the arena's own light; 1 in normal light.
        rendered: share of the arena's light that the renderer is given. In 8 bits the true share of a dim scene
            would leave a few grey levels.
        lamp: radiance in the lamp's beam of a white surface that faces it from 1 m.
    """

    arena: float
    rendered: float
    lamp: float


class Lighting(Enum):
    """Daylight, the emergency lights of a building, or nothing but the robot's lamp."""

    normal = Light(1, 1, 0)
    dim = Light(0.03, 0.2, 0)
    dark = Light(0, 0, 1.6)


BEAM_EXPONENT = 4
"""The lamp's beam falls as this power of the cosine off its axis: to a half at 33°, so that it fills the view.

With that, 1,000 lm (an LED of 10 W) are 1000 (4 + 1) / 2π = 796 cd along the axis: at 1 m, 1.6 times the 500 lux that
EN 12464-1 asks of a lit workplace, the normal light here.
"""


def set_lighting(physics: mjcf.Physics, robot: SkidSteered, lighting: Lighting) -> None:
    """Dim the arena's lights and the headlight, and switch the robot's lamp.

    The renderer has the lamp shine evenly and without loss: how it really falls off depends on each pixel's
    distance, which :func:`radiance` knows.
    """
    light, model = lighting.value, physics.model
    lamp = physics.bind(robot.lamp).element_id
    arena_lights = np.arange(model.nlight) != lamp
    for colours in (model.light_ambient, model.light_diffuse, model.light_specular):
        colours[arena_lights] *= light.rendered
    headlight = model.vis.headlight
    for colours in (headlight.ambient, headlight.diffuse, headlight.specular):
        colours *= light.rendered
    model.light_active[lamp] = light.lamp > 0
    model.light_attenuation[lamp] = (1, 0, 0)
    model.light_cutoff[lamp], model.light_exponent[lamp] = 180, 0


def radiance(image: LabelledImage, lighting: Lighting) -> NDArray[np.float32]:
    """(H, W, 3) float32 radiance of what an image shows; 1 for white in normal light.

    ``image`` is a true one, of a model that :func:`set_lighting` has set to the same lighting.
    """
    light, rendered = lighting.value, image.rgb * np.float32(1 / 255)
    if light.lamp > 0:
        return rendered * lamp_light(image, light.lamp)[..., None]
    return rendered * np.float32(light.arena / light.rendered)


def lamp_light(image: LabelledImage, lamp: float) -> NDArray[np.float32]:
    """(H, W) float32 light of the lamp on what each pixel shows: inverse square, in a beam along the optical axis.

    0 where the pixel shows nothing. The lamp is 4 cm below the camera; the beam is the camera's all the same.
    """
    range_squared = np.square(distances(image))
    lit = range_squared > 0
    strength = lamp * beam(image.intrinsics) / np.maximum(range_squared, NEAREST**2)
    return np.where(lit, strength, np.float32(0)).astype(np.float32)


def distances(image: LabelledImage) -> NDArray[np.float32]:
    """(H, W) float32 m from the camera along each pixel's ray; 0 where it shows nothing."""
    return image.depth * stretch(image.intrinsics)


@lru_cache(maxsize=4)
def stretch(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(H, W) float32 distance along each pixel's ray over depth."""
    return np.linalg.norm(intrinsics.rays, axis=2).astype(np.float32)


@lru_cache(maxsize=4)
def beam(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(H, W) float32 share of the lamp's strength in the direction of each pixel."""
    return stretch(intrinsics) ** np.float32(-BEAM_EXPONENT)  # 1 / stretch is the cosine off the axis
