"""Parameters of the segments: how planes are found in a frame, and when they become one segment."""

from dataclasses import dataclass
from math import radians

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True)
class SegmentsConfig:
    """All parameters of the segments.

    Attributes:
        angle: maximum angle between the normals of a surfel and its region, rad.
        cell: edge length of the cells in which a segment was seen, m.
        flatness: maximum distance from the plane of a segment, m, of the corners of the box of another segment that
            continues it, less half the thickness of the box.
        checkpoint_interval: number of members between saved states. When a keyframe moves, members are merged again
            from the last state saved before the keyframe's first member.
    """

    angle: float = radians(20)
    cell: float = 0.05
    flatness: float = 0.05
    checkpoint_interval: int = 64

    def __post_init__(self) -> None:
        if not 0 < self.angle < radians(90):
            raise InputError(f"segments.angle = {self.angle}: must be greater than 0 and less than a right angle")
        require_positive("segments", self, "cell", "flatness")
        require_at_least(1, "segments", self, "checkpoint_interval")
