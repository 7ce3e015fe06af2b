"""The robot's sensors applied to a true image: lighting, air, and the sensors' own errors."""

from dataclasses import dataclass, field, replace

import numpy as np

from sarsim.sensors.air import Air
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.colour_sensor import expose
from sarsim.sensors.lighting import Lighting, radiance
from sarsim.sensors.xtion import Xtion


@dataclass(frozen=True)
class Conditions:
    """The conditions of an episode.

    Attributes:
        depth_sensor: the depth sensor, with its range and errors.
        lighting: the lighting; the model must be set to it by :func:`sarsim.sensors.lighting.set_lighting`.
        air: the air, with its dust.
    """

    depth_sensor: Xtion = field(default_factory=Xtion)
    lighting: Lighting = Lighting.normal
    air: Air = field(default_factory=Air)

    def sense(self, truth: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        """The image as the sensors see it.

        The depth sensor draws from ``rng`` itself, dust and colours from generators spawned from it, so that neither
        light nor dust changes the depth sensor's own errors.
        """
        dust_rng, colour_rng = rng.spawn(2)
        measured = self.depth_sensor.apply(truth, rng)
        thinned = self.air.thin(measured, truth, self.depth_sensor.min_range, dust_rng)
        seen = self.air.veil(radiance(truth, self.lighting), truth, self.lighting)
        return replace(thinned, rgb=expose(seen, colour_rng))
