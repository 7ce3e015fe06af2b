"""Parameters of reading recordings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DatasetsConfig:
    """How recordings are read.

    Attributes:
        at_rest: time at the start over which accelerometer readings are averaged to find the vertical, s.
        buffered: number of depth images to buffer, because they may arrive out of order and colour images may lag.
        depth_units: default number of units of a depth image per metre.
    """

    at_rest: float = 0.5
    buffered: int = 15
    depth_units: float = 5000.0
