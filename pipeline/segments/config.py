"""Parameters for finding planes in a frame and for merging planes into segments."""

from dataclasses import dataclass
from math import radians

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True)
class SegmentsConfig:
    """All parameters of the segments.

    Attributes:
        angle: maximum angle between the normal of a surfel and the mean normal of its region, rad.
        cell: edge length of the cells in which a segment was seen, m.
        flatness: maximum distance between a segment's plane and the corners of another segment's box for both
            segments to lie in one plane, m. Half the thickness of the box is subtracted from the distance.
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
