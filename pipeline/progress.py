"""The progress of a run."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """The current activity of a run, and the completed fraction of the run.

    Attributes:
        text: the robot's activity and the explored area, or the results that are being written at the end.
        fraction: fraction of the run that is done, 0 to 1; None if unknown.
        is_timed: whether ``fraction`` is a fraction of time, so that the remaining time follows from it.
    """

    text: str
    fraction: float | None = None
    is_timed: bool = False
