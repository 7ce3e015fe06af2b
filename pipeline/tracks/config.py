"""Parameters of tracking people and finds over frames."""

from dataclasses import dataclass

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """Conditions for reporting a track.

    A keyframe has the highest confidence, from 0 to 1, of its detections of the object; a miss has a confidence of 0.

    Attributes:
        confidence: value that the mean confidence of detections and misses must exceed; 0.5 means more likely real
            than not.
        evidence: minimum sum of the confidences.
        full_size: visible size of most objects of the kind, m; anything smaller may be part of another object.
        evidence_of_part: minimum sum of the confidences if less than ``full_size`` is seen.
        misses: maximum number of misses per keyframe that shows the object, exclusive; None for no limit.
        baseline: minimum distance between the two camera positions that are farthest apart, m. From a single
            position, the edge of an object may look like another object.
    """

    confidence: float = 0.0
    evidence: float = 0.0
    full_size: float = 0.0
    evidence_of_part: float = 0.0
    misses: float | None = None
    baseline: float = 0.0

    def __post_init__(self) -> None:
        require_at_least(
            0, "confirmation", self, "confidence", "evidence", "full_size", "evidence_of_part", "baseline"
        )
        if self.misses is not None:
            require_positive("confirmation", self, "misses")


Extents = tuple[float, float, float]
"""Three extents, the longest first, m."""


@dataclass(frozen=True, kw_only=True)
class PeopleConfig:
    """When a person is reported, and when a suspected person is looked at again.

    Attributes:
        confirmation: when a person is reported.
        evidence_to_look: minimum sum of the confidences for which an unconfirmed person is worth a drive.
    """

    confirmation: Confirmation = Confirmation(
        evidence=0.75, full_size=0.85, evidence_of_part=1.2, misses=1.0, baseline=0.3
    )
    evidence_to_look: float = 0.5

    def __post_init__(self) -> None:
        require_at_least(0, "tracks.victim", self, "evidence_to_look")


@dataclass(frozen=True, kw_only=True)
class ObjectConfig:
    """How one kind of sign, code, object or heat is tracked.

    Attributes:
        confirmation: when an object is reported.
        across: width of the object that must be in the image when the object is looked at again, m; by default, the
            width of the largest signs.
        min_readable_side: minimum side length at which signs and codes are reliably read, pixels; the default is two
            pixels per module of a small QR code.
        max_person_distance: maximum distance from a person at which a find belongs to that person, m.
        is_flat: whether the object looks the same from all directions, so that only a nearer view shows more.
        has_checksum: whether a checksum ensures that the object is decoded correctly or not at all; an object that is
            not decoded is not reported.
        extents: median extents of each form of the kind, m; a kind without extents is not weighed against background.
    """

    confirmation: Confirmation = Confirmation(confidence=0.5)
    across: float = 0.3
    min_readable_side: float = 60.0
    max_person_distance: float = 0.0
    is_flat: bool = False
    has_checksum: bool = False
    extents: tuple[Extents, ...] = ()

    def __post_init__(self) -> None:
        require_positive("a kind of finds", self, "across", "min_readable_side")
        require_at_least(0, "a kind of finds", self, "max_person_distance")
        if not all(extent > 0 for form in self.extents for extent in form):
            raise InputError(f"a kind of finds.extents = {self.extents}: must be greater than 0")


@dataclass(frozen=True)
class ReobservationConfig:
    """The reward for another look at an object, and the number of tries.

    Attributes:
        reward: area of unseen ground to which a viewpoint towards an object is equivalent, m².
        max_tries: maximum number of tries to see an object again.
    """

    reward: float = 1.0
    max_tries: int = 4

    def __post_init__(self) -> None:
        require_at_least(0, "tracks.reobservation", self, "reward", "max_tries")


@dataclass(frozen=True)
class TracksConfig:
    """How people and heat are tracked, and when they are looked at again; readers have settings for other kinds."""

    victim: PeopleConfig = PeopleConfig()
    heat: ObjectConfig = ObjectConfig(max_person_distance=0.4)
    reobservation: ReobservationConfig = ReobservationConfig()
