"""How far a run is, for those who watch it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes:
        text: what the robot does and how much is explored, or what is written at the end.
        share: of the run that is done, 0 to 1; None if nobody can know.
        is_timed: whether the share is one of time, so that the time left follows from it.
    """

    text: str
    share: float | None = None
    is_timed: bool = False
