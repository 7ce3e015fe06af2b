"""Settings for reading recordings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DatasetsConfig:
    """How recordings are read.

    Attributes:
        at_rest: time at the start over which accelerometer readings are averaged to find the vertical, s.
        buffered: number of depth images to buffer, because depth images may arrive out of order, and colour images
            may arrive late.
        depth_units: default number of units of an integer depth image per metre.
    """

    at_rest: float = 0.5
    buffered: int = 15
    depth_units: float = 5000.0
