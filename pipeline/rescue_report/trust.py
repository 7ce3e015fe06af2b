"""How far the robot's map can be trusted, by what the robot itself can know."""

from dataclasses import dataclass

import numpy as np

from pipeline.localisation.agreement import Agreement, agreement
from pipeline.localisation.slam import Slam
from pipeline.mapper import Mapper

CHECKED = 100
"""Keyframes, at most, that are held against the map; evenly over the drive."""
CONTRADICTED = 0.01
"""Share of what keyframes show that the map may contradict: where the pose is right to 2 cm it is 0.002, where the
heading drifts by 8° in 28 m 0.018, by 16° 0.10."""
UNCERTAIN = 0.3
"""m, standard deviation at which a place may be taken for the one beside it: the width of a robot's way is 0.6."""


@dataclass(frozen=True)
class Trust:
    """What speaks against the map.

    Attributes:
        contradicted: share of what keyframes show that is not as the map has it, which is made of all of them: where
            walls stand twice, keyframes see through the one and what is before the other.
        deviation: m, standard deviation of the place that is known worst, seen from the newest keyframe; 0 for a
            robot that takes its odometry at its word.
    """

    contradicted: float
    deviation: float

    @property
    def is_consistent(self) -> bool:
        """Whether the map is as its keyframes show it."""
        return self.contradicted <= CONTRADICTED

    @property
    def is_certain(self) -> bool:
        """Whether every place is known well enough."""
        return self.deviation <= UNCERTAIN

    @property
    def is_good(self) -> bool:
        """Whether nothing speaks against the map."""
        return self.is_consistent and self.is_certain


def trust_in(mapper: Mapper) -> Trust:
    """Hold a mapper's map against its keyframes and its localisation."""
    kept = list(zip(mapper.observations, mapper.poses, strict=True))
    checked = kept[:: 1 + len(kept) // CHECKED]
    whole = Agreement.of(agreement(seen.frame, T @ seen.T_base_camera, mapper.metric_map) for seen, T in checked)
    known = mapper.localisation
    deviations = known.graph.deviations() if isinstance(known, Slam) and len(known.graph) else np.zeros(1)
    return Trust(1 - whole.share, float(deviations.max()))
