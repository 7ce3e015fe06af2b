"""How far the robot's map can be trusted, according to the robot's own data."""

from dataclasses import dataclass

import numpy as np

from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper
from pipeline.rescue_report.config import TrustConfig


@dataclass(frozen=True)
class Trust:
    """Evidence against the map.

    Attributes:
        contradicted: share of the keyframes' depth that contradicts the map, which is built from all keyframes: if a
            wall is mapped twice, keyframes see through one copy, and see surfaces in front of the other.
        deviation: standard deviation of the least certain keyframe's position relative to the newest keyframe, m; 0
            for a robot that relies on its odometry alone.
        config: limits of these values.
    """

    contradicted: float
    deviation: float
    config: TrustConfig = TrustConfig()

    @property
    def is_consistent(self) -> bool:
        """Whether the map agrees with its keyframes."""
        return self.contradicted <= 1 - self.config.agreement

    @property
    def is_certain(self) -> bool:
        """Whether every keyframe's position is certain enough."""
        return self.deviation <= self.config.deviation

    @property
    def is_good(self) -> bool:
        """Whether there is no evidence against the map."""
        return self.is_consistent and self.is_certain


def trust_in(mapper: Mapper, config: TrustConfig) -> Trust:
    """Check a mapper's map against its keyframes and its localisation."""
    kept = list(zip(mapper.keyframes.seen, mapper.keyframes.poses, strict=True))
    checked = kept[:: 1 + len(kept) // config.checked]
    slam, metric_map, belief = mapper.localisation, mapper.metric_map, mapper.belief.config
    whole = Agreement.of(agreement(seen.frame, T @ seen.T_base_camera, metric_map, belief) for seen, T in checked)
    deviations = slam.deviations if isinstance(slam, Slam) and len(slam.graph) else np.zeros(1)
    return Trust(1 - whole.share, float(deviations.max()), config)
