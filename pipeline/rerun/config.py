"""Parameters of the recording."""

from dataclasses import dataclass

from pipeline.errors import require_at_least, require_positive


@dataclass(frozen=True)
class RerunConfig:
    """Limits of the amount of logged data, and of the time for completing the recording.

    Attributes:
        point_spacing: spacing of the drawn points of the semantic map and of trajectories, m; logging all points
            would make the file large.
        motion_period: minimum time between two logged poses of the moving robot, s.
        flush_timeout: maximum time at the end until the file and the viewer have received all data, s.
    """

    point_spacing: float = 0.04
    motion_period: float = 0.2
    flush_timeout: float = 30.0

    def __post_init__(self) -> None:
        require_positive("rerun", self, "point_spacing", "flush_timeout")
        require_at_least(0, "rerun", self, "motion_period")
