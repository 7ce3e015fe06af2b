"""Parameters of the rescue report."""

from dataclasses import dataclass, fields

from pipeline.errors import require_positive


@dataclass(frozen=True)
class RescueReportConfig:
    """Which hazards are reported to rescuers, how far paths and drawings reach, and when the map can be trusted.

    Attributes:
        drop: minimum height of a drop, m, because a robot that climbs stairs can also climb lower steps. The edge of
            a drop differs in height by less than this from the ground in front of it, a kerb by more.
        upright: headroom below which a person must stoop, m.
        ahead: distance beyond the reachable ground within which more ground is expected unless a wall or step is in
            between, m.
        person_area: minimum area that a person takes up, m².
        arrival: maximum distance from the robot's centre to a person's points at which the robot is next to the
            person, m.
        contradicted: maximum fraction of the keyframes' depth that contradicts a trusted map. The fraction is 0.002
            if poses are correct to 2 cm, 0.018 if the heading drifts by 8° in 28 m, and 0.10 if it drifts by 16°.
        deviation: standard deviation above which a position may be mistaken for an adjacent one, m, because a robot's
            path is 0.6 m wide.
        max_listed: maximum number of places of one kind that are numbered on the drawing and listed on the page, the
            worst first.
    """

    drop: float = 0.1
    upright: float = 2.0
    ahead: float = 1.0
    person_area: float = 0.2
    arrival: float = 1.0
    contradicted: float = 0.01
    deviation: float = 0.3
    max_listed: int = 10

    def __post_init__(self) -> None:
        require_positive("rescue_report", self, *(field.name for field in fields(self)))
