"""Parameters of reading recordings."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DatasetsConfig:
    """How recordings are read.

    Attributes:
        at_rest: time at the start during which an accelerometer measures the vertical, s.
        buffered: number of depth images that are buffered: they may come out of order, and colour images may lag.
        depth_units: units of depth images per metre, by default.
    """

    at_rest: float = 0.5
    buffered: int = 15
    depth_units: float = 5000.0
