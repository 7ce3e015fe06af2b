"""Points of one plane decide together what they are.

A network that sees one column at a time errs in speckles, and at edges, where its voxels hold two surfaces. But a
plane is hardly ever of two classes, and where two planes meet is known better from their equations than from the
class of any point. So planar regions are found without labels, every pixel goes to the plane that its ray meets
nearest, and what a point is follows from its own probabilities and from those of all points on its plane.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.semantic_map.planar_regions import RegionsConfig, planar_regions
from pipeline.semantic_map.planar_vote_kernels import mean_logs, normalised_products
from pipeline.semantic_map.surfels_kernels import planes_of_pixels


@dataclass(frozen=True)
class PlanarVoteConfig:
    """Settings of the vote."""

    regions: RegionsConfig = field(
        default_factory=lambda: RegionsConfig(max_angle=np.deg2rad(6), max_shift=0.02, noise=0.008)
    )
    """How planes are found; without labels they must be told apart by smaller angles."""
    weight: float = 2.0
    """Of the plane's mean opinion, as evidence; a point's own is 1."""
    floor: float = 1e-3
    """Least probability of a class: how little a network is believed that rules one out."""


def planar_vote(
    frame: Frame, probabilities: NDArray[np.float32], config: PlanarVoteConfig | None = None
) -> NDArray[np.float32]:
    """Let the points of every plane vote.

    The probabilities of a point on a plane become the normalised product of its own and of the geometric mean over
    all points of the plane, the latter to the power of ``weight``. The others keep theirs.

    Args:
        frame: a look.
        probabilities: (N, C) float32 of its returns, row-major; the rows sum to 1.
        config: settings.

    Returns:
        (N, C) float32.
    """
    config = config or PlanarVoteConfig()
    regions = config.regions
    found = planar_regions(frame, frame.returns.astype(np.uint8), 0, regions)
    plane = planes_of_pixels(
        frame.depth, frame.intrinsics.rays, found.surfels.of_pixel, found.surfels.near, found.region,
        found.planes, regions.max_shift, regions.noise,
    )[frame.returns]  # fmt: skip
    logs = np.log(np.maximum(probabilities, np.float32(config.floor)))
    evidence = config.weight * mean_logs(logs, plane, len(found.planes))
    return normalised_products(probabilities, logs, evidence, plane)
