"""The ASUS Xtion PRO LIVE: what a structured-light sensor makes of the true depth."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from sarsim import xtion_kernels
from sarsim.camera import LabelledImage


@dataclass(frozen=True)
class Xtion:
    """The sensor's range and its errors, each of which can be switched off.

    Sources: axial noise from Nguyen, Izadi & Lovell, "Modeling Kinect sensor noise" (3DIMPVT 2012), a sensor of the
    same make; steps of disparity from Khoshelham & Elberink, "Accuracy and resolution of Kinect depth data"
    (Sensors 2012); range from the maker's data sheet.
    """

    min_range: float = 0.8
    """m along the optical axis; nothing nearer returns."""
    max_range: float = 3.5
    """m along the optical axis; nothing farther returns."""
    axial_noise: bool = True
    """Gaussian noise of depth that grows with distance, and steeply past 60° of incidence."""
    lateral_noise: bool = True
    """Frayed edges: near one, a pixel may see what lies across it."""
    lateral_sigma: float = 0.8
    """pixels."""
    quantisation: bool = True
    """Depth in steps of disparity, so coarser the farther."""
    disparity_step: float = 1 / 8
    """pixels."""
    baseline: float = 0.075
    """m from the camera to the projector, which stands to its right."""
    grazing: bool = True
    """No return from surfaces that are seen at a grazing angle."""
    max_incidence: float = 82.0
    """degrees between the line of sight and the surface's normal."""
    shadow: bool = True
    """No return where the projector's light does not reach: left of near edges."""
    dropout: float = 0.0
    """Share of the pixels that return nothing for no reason."""

    @classmethod
    def ideal(cls, min_range: float = 0.8, max_range: float = 3.5) -> Self:
        """A sensor with a range and no errors."""
        return cls(
            min_range=min_range,
            max_range=max_range,
            axial_noise=False,
            lateral_noise=False,
            quantisation=False,
            grazing=False,
            shadow=False,
        )

    def apply(self, image: LabelledImage, rng: np.random.Generator) -> LabelledImage:
        """The image with measured depth. Label and instance are those of the surface that each depth comes from."""
        depth, source = self.measure(image.depth, image.intrinsics, rng)
        return replace(
            image, depth=depth, label=image.label.ravel()[source], instance=image.instance.ravel()[source]
        )

    def measure(
        self, depth: NDArray[np.float32], intrinsics: Intrinsics, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Measured depth, and where in the picture each value was taken.

        Args:
            depth: (H, W) float32 true depth in metres; 0 = nothing there.
            intrinsics: of ``depth``.
            rng: drawn from once a call, whatever is switched on.

        Returns:
            (H, W) float32 depth in metres, 0 = no return, and (H, W) int32 flat index of the pixel whose true depth
            was measured: another one than the pixel itself only beside a depth edge.
        """
        key = rng.integers(1 << 64, dtype=np.uint64)
        noise = self._noise(intrinsics)
        inverse_depth = np.divide(1, depth, out=np.zeros_like(depth), where=depth > 0)
        if self.shadow:
            shadow = xtion_kernels.projector_shadow(inverse_depth, noise.focal_baseline)
        else:
            shadow = np.zeros(depth.shape, np.bool_)
        return xtion_kernels.measure(inverse_depth, shadow, key, noise)

    def _noise(self, intrinsics: Intrinsics) -> xtion_kernels.Noise:
        focal_baseline = intrinsics.fx * self.baseline
        return xtion_kernels.Noise(
            fx=intrinsics.fx,
            fy=intrinsics.fy,
            cx=intrinsics.cx,
            cy=intrinsics.cy,
            focal_baseline=focal_baseline,
            nearest=self.min_range,
            farthest=self.max_range,
            axial=float(self.axial_noise),
            lateral=self.lateral_sigma if self.lateral_noise else 0.0,
            edge=2 * self.disparity_step / focal_baseline,  # smaller breaks drown in the quantisation
            step=self.disparity_step if self.quantisation else 0.0,
            grazing=float(np.cos(np.radians(self.max_incidence))) if self.grazing else 0.0,
            dropout=self.dropout,
        )
