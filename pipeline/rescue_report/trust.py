"""How far the robot's map can be trusted, by the robot's own data."""

from dataclasses import dataclass

import numpy as np

from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.gates import CONFIDENCE
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper

MOST_CHECKED = 100
"""Most keyframes that are compared with the map, evenly spread over the drive."""
MOST_DEVIATION = 0.3
"""m, standard deviation at which a place may be mistaken for the next one: a robot's way is 0.6 m wide."""


@dataclass(frozen=True)
class Trust:
    """Evidence against the map.

    Attributes:
        contradicted: share of the keyframes' depth that contradicts the map, which is made of all keyframes: if a
            wall stands twice, keyframes see through one copy, and see surfaces in front of the other.
        deviation: m, standard deviation of the least certain keyframe's place relative to the newest keyframe; 0 for
            a robot that relies on its odometry alone.
    """

    contradicted: float
    deviation: float

    @property
    def is_consistent(self) -> bool:
        """Whether the map agrees with its keyframes.

        The share is 0.002 with poses right to 2 cm, 0.018 with a heading that drifts by 8° in 28 m, 0.10 with 16°.
        """
        return self.contradicted <= 1 - CONFIDENCE

    @property
    def is_certain(self) -> bool:
        """Whether every keyframe's place is certain enough."""
        return self.deviation <= MOST_DEVIATION

    @property
    def is_good(self) -> bool:
        """Whether there is no evidence against the map."""
        return self.is_consistent and self.is_certain


def trust_in(mapper: Mapper) -> Trust:
    """Check a mapper's map by its keyframes and its localisation."""
    kept = list(zip(mapper.keyframes.seen, mapper.keyframes.poses, strict=True))
    checked = kept[:: 1 + len(kept) // MOST_CHECKED]
    slam, metric_map, config = mapper.localisation, mapper.metric_map, mapper.localisation.belief.config
    whole = Agreement.of(agreement(seen.frame, T @ seen.T_base_camera, metric_map, config) for seen, T in checked)
    deviations = slam.deviations if isinstance(slam, Slam) and len(slam.graph) else np.zeros(1)
    return Trust(1 - whole.share, float(deviations.max()))
