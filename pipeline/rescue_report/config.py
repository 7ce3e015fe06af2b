"""Parameters of the rescue report."""

from dataclasses import dataclass, fields

from pipeline.errors import require_positive


@dataclass(frozen=True)
class RescueReportConfig:
    """Limits of the hazards, paths and places that are reported to rescuers, and of the evidence against the map.

    Attributes:
        drop: minimum height of a drop, m; a robot that climbs stairs can also climb lower steps. The edge of a drop
            differs in height from the ground in front of it by less than this value, a kerb by more.
        upright_headroom: headroom below which a person must stoop, m.
        expected_extent: distance beyond the reachable ground within which more ground is expected unless a wall or
            step is in between, m.
        person_area: minimum area that a person takes up, m².
        arrival: maximum horizontal distance, m, between the end of a path and the nearest of a person's points at
            which the robot is next to the person.
        max_contradicted_fraction: maximum fraction of the keyframes' depth that may contradict a trusted map. The
            fraction is 0.002 if poses are correct to 2 cm, 0.018 if the heading drifts by 8° in 28 m, and 0.10 if the
            drift is 16°.
        deviation: maximum standard deviation of a keyframe's position in a trusted map, m. A robot's path is 0.6 m
            wide, so a less certain position may be mistaken for an adjacent one.
        max_listed: maximum number of places of one kind that are numbered on the drawing and listed on the page, the
            worst first.
    """

    drop: float = 0.1
    upright_headroom: float = 2.0
    expected_extent: float = 1.0
    person_area: float = 0.2
    arrival: float = 1.0
    max_contradicted_fraction: float = 0.01
    deviation: float = 0.3
    max_listed: int = 10

    def __post_init__(self) -> None:
        require_positive("rescue_report", self, *(field.name for field in fields(self)))
