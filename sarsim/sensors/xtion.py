"""The ASUS Xtion PRO LIVE: a noise model of a structured-light depth sensor."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, PixelMask
from pipeline.frame import Intrinsics
from pipeline.sensor import XTION
from sarsim.sensors import xtion_kernels as kernels
from sarsim.sensors.camera import LabelledImage

MIN_EDGE_JUMP = 0.25  # pixels of disparity, two of the sensor's steps; a smaller jump is not an edge
DISPARITY_STEP = np.float32(1 / 8)  # pixels
BASELINE = 0.075  # m from the camera to the projector, which is to its right
MAX_INCIDENCE = 82.0
"""degrees between the line of sight and the surface's normal; at larger angles there is no return."""


@dataclass(frozen=True)
class Xtion:
    """The sensor's range and its errors, each of which can be switched off.

    Sources: axial noise from Nguyen, Izadi & Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction
    and tracking" (3DIMPVT 2012), for a sensor of the same make; steps of disparity from Khoshelham & Elberink,
    "Accuracy and resolution of Kinect depth data" (Sensors 2012); range from the maker's data sheet.
    """

    min_range: float = XTION.nearest
    """m along the optical axis; nearer surfaces give no return."""
    max_range: float = XTION.farthest
    """m along the optical axis; farther surfaces give no return."""
    axial_noise: bool = True
    """Whether depth has Gaussian noise, which grows with distance, and steeply beyond 60° of incidence."""
    lateral_noise: bool = True
    """Whether edges are frayed: near a depth edge, a pixel may measure the surface on the other side of the edge."""
    lateral_sigma: float = 0.8
    """pixels, standard deviation of the lateral noise."""
    quantisation: bool = True
    """Whether depth is quantised in steps of disparity, which make the steps of depth grow with distance."""
    grazing: bool = True
    """Whether surfaces that are seen at a grazing angle give no return."""
    shadow: bool = True
    """Whether surfaces that the projector's light does not reach, left of near edges, give no return."""
    dropout: float = 0.0
    """Fraction of the pixels that give no return at random."""

    @classmethod
    def ideal(cls, min_range: float = XTION.nearest, max_range: float = XTION.farthest) -> Self:
        """A sensor with a range and no errors."""
        off = dict.fromkeys(("axial_noise", "lateral_noise", "quantisation", "grazing", "shadow"), False)
        return cls(min_range=min_range, max_range=max_range, **off)

    def apply(self, image: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        """The image with measured depth; label and instance are those of the surface whose depth was measured."""
        depth, source = self.measure(image.depth, image.intrinsics, rng)
        if not self.lateral_noise:
            return replace(image, depth=depth)
        label, instance = image.label.ravel()[source], image.instance.ravel()[source]
        return replace(image, depth=depth, label=label, instance=instance)

    def measure(
        self, depth: Depth, intrinsics: Intrinsics, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Measured depth, and for each pixel the pixel whose true depth it measured.

        Args:
            depth: (H, W) m, true depth; 0 = no surface.
            intrinsics: intrinsics of ``depth``.
            rng: random generator, from which one number is drawn per call, whichever errors are switched on.

        Returns:
            (H, W) float32 m, measured depth, 0 = no return, and (H, W) int64, flat index of the pixel whose true
            depth was measured; this is another pixel only next to a depth edge.
        """
        key = rng.integers(1 << 64, dtype=np.uint64)
        source = np.arange(depth.size).reshape(depth.shape)
        if self == self.ideal(self.min_range, self.max_range):
            return self._in_range(depth), source
        bits = kernels.random_bits(key, *depth.shape)
        disparity = np.divide(np.float32(intrinsics.fx * BASELINE), depth, out=np.zeros_like(depth), where=depth > 0)
        slopes = kernels.slopes(disparity)
        cosine = kernels.cosine_of_incidence(disparity, *slopes, intrinsics.rays, intrinsics.fx, intrinsics.fy)
        if self.lateral_noise:
            source = kernels.lateral_source(disparity, *slopes, bits, self.lateral_sigma, MIN_EDGE_JUMP)
        measured = np.where(self._returns(disparity, cosine, bits), depth, np.float32(0)).ravel()[source]
        if self.axial_noise:
            kernels.add_noise(measured, kernels.axial_sigma(depth, cosine).ravel()[source], bits)
        if self.quantisation:
            kernels.quantise(measured, np.float32(intrinsics.fx * BASELINE), DISPARITY_STEP)
        return self._in_range(measured), source

    def _in_range(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.where((depth >= self.min_range) & (depth <= self.max_range), depth, np.float32(0))

    def _returns(
        self, disparity: NDArray[np.float32], cosine: NDArray[np.float32], bits: NDArray[np.uint64]
    ) -> PixelMask:
        """The pixels whose surface returns the projector's light."""
        returns = disparity > 0
        if self.grazing:
            returns &= cosine > np.cos(np.radians(MAX_INCIDENCE))
        if self.shadow:
            returns &= ~kernels.projector_shadow(disparity)
        if self.dropout > 0:
            returns &= (bits >> np.uint64(48)) >= self.dropout * (1 << 16)
        return returns
