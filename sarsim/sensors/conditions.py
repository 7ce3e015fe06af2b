"""The robot's sensors applied to a true image: lighting, air, and the sensors' own errors.

A small colour sensor exposes for at most one video frame; in less light, it raises its gain. The numbers are those of
a 1/4 inch VGA sensor with pixels of 3 µm, the type that such cameras have.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from sarsim.sensors import colour_kernels
from sarsim.sensors.air import Air
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.lighting import Lighting, radiance
from sarsim.sensors.xtion import Xtion
from sarsim.sensors.xtion_kernels import random_bits

FULL_WELL = 4000.0  # electrons that the sensor counts for white in normal light
READ_NOISE = 6.0  # electrons, standard deviation
MAX_GAIN = 8.0  # Maximum amplification of the signal
TARGET_MEAN = 0.3  # Target of the gain control: mean pixel value, from 0 to 1


@dataclass(frozen=True)
class Conditions:
    """The conditions that make the camera's images differ from the truth.

    Attributes:
        depth_sensor: the depth sensor, with its range and errors.
        lighting: the lighting; the model must be set to it by :func:`sarsim.sensors.lighting.set_lighting`.
        air: the air, with its dust.
    """

    depth_sensor: Xtion = field(default_factory=Xtion)
    lighting: Lighting = Lighting.normal
    air: Air = field(default_factory=Air)

    def sense(self, truth: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        """The image as the sensors measure it.

        The depth sensor draws numbers from ``rng`` itself, whereas dust and colours use generators spawned from it.
        Therefore, neither light nor dust changes the depth sensor's own errors.
        """
        dust_rng, colour_rng = rng.spawn(2)
        measured = self.depth_sensor.apply(truth, rng)
        nearest, farthest = self.depth_sensor.min_range, self.depth_sensor.max_range
        thinned = self.air.apply_to_depth(measured, truth, nearest, farthest, dust_rng)
        seen = self.air.veil(radiance(truth, self.lighting), truth, self.lighting)
        return replace(thinned, rgb=expose(seen, colour_rng))


def expose(radiance: NDArray[np.float32], rng: np.random.Generator) -> Rgb:
    """(H, W, 3) uint8 image of (H, W, 3) float32 radiance, where 1 is white in normal light.

    One number is drawn from ``rng``.
    """
    bits = random_bits(rng.integers(1 << 64, dtype=np.uint64), *radiance.shape[:2])
    return colour_kernels.expose(radiance, bits, exposure_gain(radiance), FULL_WELL, READ_NOISE)


def exposure_gain(radiance: NDArray[np.float32]) -> float:
    """Amplification that brings the mean of (H, W, 3) float32 radiance to the target, from 1 to ``MAX_GAIN``."""
    mean = float(radiance.mean(dtype=np.float64))
    return float(np.clip(TARGET_MEAN / max(mean, 1e-9), 1, MAX_GAIN))
