"""Dust in the air, which absorbs depth returns, causes false returns and veils colours."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from sarsim.sensors import air_kernels
from sarsim.sensors.camera import LabelledImage
from sarsim.sensors.lighting import Lighting, beam, distance_per_depth, distances
from sarsim.sensors.xtion_kernels import random_bits

MAX_EXTINCTION = 0.5
"""1/m, extinction in the densest dust: contrast falls to 2% over 3.9 / 0.5 = 8 m (Koschmieder), as in thick fog."""
DUST_COLOUR = np.array((0.62, 0.60, 0.56), np.float32)  # Colour of dust in white light
LAMP_VEIL = 0.5  # Ratio of the radiance of infinitely deep dust in the lamp's beam to that of a white surface at 1 m
SPECK_RATE = 0.05  # Probability, in the densest dust, that an infinite ray returns from a speck


@dataclass(frozen=True)
class Air:
    """Dust between the robot and the surfaces that it sees.

    Attributes:
        dust: concentration, from 0 for clear air to 1.
    """

    dust: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.dust <= 1:
            raise InputError(f"dust must be from 0 to 1, not {self.dust:g}")

    @property
    def extinction(self) -> float:
        """β in the Beer-Lambert law e^(−β r), 1/m: the fraction of light lost per metre in thin layers."""
        return MAX_EXTINCTION * self.dust

    def veil(self, radiance: NDArray[np.float32], truth: LabelledImage, lighting: Lighting) -> NDArray[np.float32]:
        """(H, W, 3) float32 radiance seen through the dust, blended with the scattered light according to distance.

        The lamp's light is also attenuated on its path to the surface, and dust in its beam scatters light back.
        """
        if self.dust == 0:
            return radiance
        distance = distances(truth)
        reach = np.where(distance > 0, distance, np.float32(np.inf))
        passing = np.exp(np.float32(-self.extinction) * reach)[..., None]
        light = lighting.value
        if light.lamp > 0:
            passing = passing**2
            dust_light = LAMP_VEIL * light.lamp * beam(truth.intrinsics)[..., None] * DUST_COLOUR
        else:
            dust_light = light.arena * DUST_COLOUR
        return (radiance * passing + dust_light * (1 - passing)).astype(np.float32)

    def apply_to_depth(
        self,
        measured: LabelledImage,
        truth: LabelledImage,
        min_range: float,
        max_range: float,
        rng: np.random.Generator,
    ) -> LabelledImage:
        """The measured image without the returns that dust absorbs, and with false returns from specks of dust.

        A return from distance r survives with probability e^(−2 β r). A ray of length r returns from a speck
        nearer than r with probability ``dust * SPECK_RATE`` (1 − e^(−2 β r)), by the same law. Specks are
        unlabelled, and specks nearer than ``min_range`` or farther than ``max_range``, m, give no return. ``truth``
        is the image before the depth sensor measured it; one number is drawn from ``rng``.
        """
        key = rng.integers(1 << 64, dtype=np.uint64)
        if self.dust == 0:
            return measured
        depth, specks = air_kernels.apply_to_depth(
            measured.depth,
            distances(truth),
            distance_per_depth(truth.intrinsics),
            random_bits(key, *measured.depth.shape),
            self.extinction,
            self.dust * SPECK_RATE,
            min_range,
            max_range,
        )
        label = np.where(specks, np.uint8(0), measured.label)
        return replace(measured, depth=depth, label=label, instance=np.where(specks, -1, measured.instance))
