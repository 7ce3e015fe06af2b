"""Ground that a look ought to have shown and did not.

A thin upright panel seen along its plane sends nothing back: its face is seen at a grazing angle, and its end may be
nearer than the camera's range. All that tells of it is a stripe of the picture without ground between ground.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Intrinsics
from pipeline.transforms import transform_points
from pipeline.traversability import depth_dropouts_kernels as kernels


@dataclass(frozen=True)
class DepthDropoutConfig:
    """What counts as a stripe without ground.

    Attributes:
        min_gap: pixels; the sensor frays edges by less.
        max_gap: pixels; whatever is wider leaves unknown ground behind it.
        tolerance: share by which the depths to the left and to the right may differ.
        min_grazing: ground that is seen at a smaller angle may send nothing back itself, rad.
        row_step: every so many rows are looked at.
    """

    min_gap: int = 3
    max_gap: int = 60
    tolerance: float = 0.06
    min_grazing: float = np.deg2rad(12)
    row_step: int = 2


def find_depth_dropouts(
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    T_map_camera: NDArray[np.float64],
    config: DepthDropoutConfig | None = None,
) -> NDArray[np.float32]:
    """(N, 3) float32 points in ``map`` where rays should have met the ground that goes on around them.

    Args:
        depth: (H, W) float32 m along the optical axis; 0 = no return.
        intrinsics: of the depth image.
        T_map_camera: pose of ``camera_optical``.
        config: what counts.
    """
    config = config or DepthDropoutConfig()
    missing = np.zeros_like(depth)
    kernels.missing_depth(
        depth,
        intrinsics.fy,
        config.max_gap,
        config.min_gap,
        np.float32(config.tolerance),
        config.min_grazing,
        config.row_step,
        missing,
    )
    v, u = np.nonzero(missing)
    return transform_points(T_map_camera, intrinsics.rays[v, u] * missing[v, u, None])
