"""Parameters of the recording."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunConfig:
    """How much is logged.

    Attributes:
        grain: spacing of the drawn points of the semantic map and of trajectories, m: all would make a large file.
        growth: relative change in size above which a cloud is logged again; all are logged at the end.
        motion_period: minimum time between two logged poses of the moving robot, s.
        photo: side of a person's or find's photo, caption included, pixels.
        patience: maximum time that the viewer may take at the start and at the end to receive the data, s.
    """

    grain: float = 0.04
    growth: float = 0.05
    motion_period: float = 0.2
    photo: int = 240
    patience: float = 30.0
