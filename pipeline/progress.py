"""The progress of a run."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """What a run is doing, and how much of it is done.

    Attributes:
        text: what the robot is doing and how much is explored, or what is being written at the end.
        share: fraction of the run that is done, 0 to 1; None if unknown.
        is_timed: whether ``share`` is a fraction of time, so that the remaining time follows from it.
    """

    text: str
    share: float | None = None
    is_timed: bool = False
