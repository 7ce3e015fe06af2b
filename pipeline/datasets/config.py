"""The numbers by which recordings are read."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DatasetsConfig:
    """How recordings are read.

    Attributes:
        at_rest: s at the beginning during which an accelerometer measures the vertical.
        buffered: depth images that are buffered: they may come out of order, and colour images may lag.
        depth_units: units of depth images per metre, unless they are given.
        most_step: s from one image to the next, hours, beyond which the times of a folder cannot be in s.
    """

    at_rest: float = 0.5
    buffered: int = 15
    depth_units: float = 5000.0
    most_step: float = 1e4
