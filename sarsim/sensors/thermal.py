"""A thermal camera: an uncooled microbolometer with the field of view of the colour camera.

Numbers are those of the FLIR Lepton (engineering data sheet): 80 × 60 pixels, a noise of 50 mK, and a range of
temperatures from -10 to 140 °C.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sarsim.sensors.camera import LabelledImage

THERMAL_SIZE = (80, 60)  # pixels, width and height
NETD = 0.05  # K, the temperature difference that equals the noise's standard deviation
MIN_TEMPERATURE, MAX_TEMPERATURE = -10.0, 140.0  # °C


@dataclass(frozen=True, eq=False)
class ThermalCamera:
    """A thermal camera with the field of view of the colour camera.

    Attributes:
        temperature: (ngeom + 1,) float32 °C, surface temperature of each geom; the last element is for pixels without
            a geom.
    """

    temperature: NDArray[np.float32]

    def image(self, truth: LabelledImage, rng: np.random.Generator) -> NDArray[np.float32]:
        """(60, 80) float32 °C, thermal image of the scene in ``truth``, a noise-free image.

        Each pixel is the mean over the pixels of ``truth`` that it covers, with noise.
        """
        shown = cv2.resize(self.temperature[truth.instance], THERMAL_SIZE, interpolation=cv2.INTER_AREA)
        noise = rng.normal(0.0, NETD, shown.shape)
        return np.clip(shown + noise, MIN_TEMPERATURE, MAX_TEMPERATURE).astype(np.float32)
