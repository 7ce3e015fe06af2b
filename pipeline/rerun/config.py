"""The numbers of the recording."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RerunConfig:
    """How much is logged.

    Attributes:
        grain: m between the drawn points of the semantic map and of tracks: all would make a large file.
        growth: share by which a cloud has to grow to be logged again; all are logged at the end.
        motion_period: s between two logged poses of the moving robot.
        photo: pixels of the sides of a person's or find's photo, its caption included.
        patience: s that the viewer may take at the end for the remaining data.
    """

    grain: float = 0.04
    growth: float = 0.05
    motion_period: float = 0.2
    photo: int = 240
    patience: float = 30.0
