"""Lighting: the arena's own lights and the robot's lamp."""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from sarsim.robots.skid_steered import SkidSteerRobot
from sarsim.sensors.camera import LabelledImage

MIN_LAMP_DISTANCE = 0.15
"""m; nearer surfaces get no more of the lamp's light than surfaces at this distance."""


@dataclass(frozen=True)
class Light:
    """The light sources of a scene.

    Attributes:
        arena: radiance of a white surface under the arena's own light; 1 in normal light.
        rendered: fraction of the arena's light with which the scene is rendered. With the true fraction, a dim scene
            would have only a few grey levels in 8 bits.
        lamp: radiance of a white surface that faces the lamp from 1 m away, on the axis of the lamp's beam.
    """

    arena: float
    rendered: float
    lamp: float


class Lighting(Enum):
    """Daylight, the emergency lights of a building, or only the robot's lamp."""

    normal = Light(1, 1, 0)
    dim = Light(0.03, 0.2, 0)
    dark = Light(0, 0, 1.6)


BEAM_EXPONENT = 4
"""Power of the cosine of the off-axis angle that gives the lamp's intensity, which falls to half at 33°.

The beam fills the view. With this exponent, 1,000 lm (an LED of 10 W) are 1000 (4 + 1) / 2π = 796 cd along the axis.
At 1 m, this is 1.6 times the 500 lux that EN 12464-1 requires at a lit workplace, which is the normal light here.
"""


def set_lighting(physics: mjcf.Physics, robot: SkidSteerRobot, lighting: Lighting) -> None:
    """Dim the arena's lights and the headlight, and switch the robot's lamp on or off.

    In the renderer, the lamp shines evenly and without attenuation, because :func:`radiance` applies the falloff,
    which depends on each pixel's distance.
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
    """(H, W, 3) float32 radiance of the surfaces in an image; 1 for white in normal light.

    ``image`` is free of noise, from a model that :func:`set_lighting` has set to the same lighting.
    """
    light, rendered = lighting.value, image.rgb * np.float32(1 / 255)
    if light.lamp > 0:
        return rendered * lamp_light(image, light.lamp)[..., None]
    return rendered * np.float32(light.arena / light.rendered)


def lamp_light(image: LabelledImage, lamp: float) -> NDArray[np.float32]:
    """(H, W) float32 light of the lamp on each pixel's surface, by the inverse-square law; 0 if there is no surface.

    The beam points along the optical axis and starts at the camera, although the lamp is 4 cm below the camera.
    """
    range_squared = np.square(distances(image))
    lit = range_squared > 0
    strength = lamp * beam(image.intrinsics) / np.maximum(range_squared, MIN_LAMP_DISTANCE**2)
    return np.where(lit, strength, np.float32(0)).astype(np.float32)


def distances(image: LabelledImage) -> NDArray[np.float32]:
    """(H, W) float32 m, distance from the camera along each pixel's ray; 0 where there is no surface."""
    return image.depth * distance_per_depth(image.intrinsics)


@lru_cache(maxsize=4)
def distance_per_depth(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(H, W) float32 ratio of the distance along each pixel's ray to the depth."""
    return np.linalg.norm(intrinsics.rays, axis=2).astype(np.float32)


@lru_cache(maxsize=4)
def beam(intrinsics: Intrinsics) -> NDArray[np.float32]:
    """(H, W) float32 intensity of the lamp in each pixel's direction, relative to the intensity along its axis."""
    return distance_per_depth(intrinsics) ** np.float32(-BEAM_EXPONENT)  # 1 / ratio is the cosine off the axis
