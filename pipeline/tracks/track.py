"""Tracks of objects over frames: the observations of an object by keyframes, and the rules for its kind."""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.arrays import Covariance, Information, Place, Planes, Points, Pose, Poses, Rgb
from pipeline.frame import Frame
from pipeline.geometry.cells_kernels import moved
from pipeline.geometry.planes import transform_planes
from pipeline.keyframes import AnchoredPlaces
from pipeline.localisation.gates import chi2_gate
from pipeline.sensor import SensorModel
from pipeline.tracks.config import Confirmation, Extents
from pipeline.tracks.find import Find, Reading
from pipeline.tracks.likelihood import extents_of
from pipeline.transforms import transform_places

GATE = chi2_gate(3, 0.99)
"""Maximum squared Mahalanobis distance between two measured positions of one object; 99% are within this distance."""
MAX_MISSES = 2.0
"""Maximum number of misses per keyframe that shows the object; a track with more misses is given up."""


@dataclass(frozen=True, eq=False)
class Observation:
    """An object as one keyframe shows it, in the keyframe's ``base_link`` or, once placed, in ``map``.

    Attributes:
        reading: reading of the object in the image.
        keyframe: index of the keyframe.
        position: middle of the object; without depth, the end of the camera's range in the object's direction.
        information: inverse of the position's covariance.
        camera: position of the camera.
        points: the object's own returns, thinned.
        photo: photo of the object; empty if another observation of the object shows more.
        time: time of the frame, s; NaN for a frame of an earlier run.
        has_depth: whether the object's distance was measured.
        walls: (P, 4) vertical planes around the object, with their normals towards the camera.
    """

    reading: Reading
    keyframe: int
    position: Place
    information: Information
    camera: Place
    points: Points
    photo: Rgb
    time: float = np.nan
    has_depth: bool = True
    walls: Planes = field(default_factory=lambda: np.zeros((0, 4)))

    def transformed(self, T: Pose) -> "Observation":
        """The same observation, transformed by ``T``."""
        information = T[:3, :3] @ self.information @ T[:3, :3].T
        position, camera = transform_places(T, self.position), transform_places(T, self.camera)
        points, walls = moved(T, self.points), transform_planes(T, self.walls)
        return replace(self, position=position, camera=camera, information=information, points=points, walls=walls)


@dataclass(frozen=True, eq=False)
class Location:
    """The location of an object according to all of its observations, in ``map``.

    Attributes:
        position: middle of the object.
        covariance: covariance of the position.
        points: points of the object.
    """

    position: Place
    covariance: Covariance
    points: Points


@dataclass(frozen=True, kw_only=True)
class TrackPolicy(ABC):
    """How one kind of object is tracked.

    Attributes:
        kind: one of :data:`pipeline.tracks.find.KINDS`, or a kind of a user's own reader.
        confirmation: when a track is reported.
        across: width of the object that must be in the image when the object is looked at again, m.
        extents: median extents of each form of the kind, m; a kind without extents is not weighed against background.
        is_flat: whether the object looks the same from all directions, so that only a nearer view shows more.
        has_checksum: whether a checksum ensures that the object is decoded correctly or not at all; an object that is
            not decoded is not reported.
    """

    kind: str
    confirmation: Confirmation
    across: float
    extents: tuple[Extents, ...] = ()
    is_flat: bool = False
    has_checksum: bool = False

    @abstractmethod
    def locate(self, placed: Sequence[Observation]) -> Location:
        """The location of an object according to its observations in ``map``, at least one."""

    def joined(self, one: "Track", other: "Track") -> Location:
        """The location of an object according to the observations of both tracks."""
        return self.locate([*one.placed, *other.placed])

    @abstractmethod
    def photo_score(self, observation: Observation) -> float:
        """How much of the object the observation's photo shows, in any unit."""

    @abstractmethod
    def distance(self, track: "Track", new: "Track") -> float:
        """Squared Mahalanobis distance of a new observation from a track; infinite if the objects are different."""

    @abstractmethod
    def merge_distance(self, one: "Track", other: "Track") -> float:
        """Distance between two tracks that may be merged; infinite if the objects are different."""

    @abstractmethod
    def is_expected_in_view(self, track: "Track", frame: Frame, T_camera_map: Pose) -> bool:
        """Whether a frame is expected to show the object, so that a frame without the object is a miss."""

    @abstractmethod
    def is_worth_a_look(self, track: "Track") -> bool:
        """Whether another look at the object is worth a drive."""

    @abstractmethod
    def viewing_range(self, track: "Track", sensor: SensorModel) -> tuple[float, float]:
        """Minimum and maximum horizontal distance from which a camera would show enough of the object, m."""

    def has_shape(self, track: "Track") -> bool:
        """Whether all points seen of the object, taken together, have the shape of the object's kind."""
        return True


@dataclass(eq=False)
class Track:
    """An object on the map, reported or not.

    Attributes:
        policy: policy for the object's kind.
        seen: observations of the object, in the ``base_link`` of their keyframes.
        placed: the same observations in ``map``.
        ground: height of the lowest ground from which the object was seen, m in ``map``.
        missed: indices of the keyframes that were expected to show the object but did not.
        tried: place on the ground from which the robot tried to see the object again, for each try; no place if the
            robot did not get there.
        tried_at: the same places in ``map``.
        location: location of the object according to all observations.
    """

    policy: TrackPolicy
    seen: list[Observation]
    placed: list[Observation]
    ground: float = 0.0
    missed: set[int] = field(default_factory=set)
    tried: list[AnchoredPlaces] = field(default_factory=list)
    tried_at: list[Place] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.location = self.policy.locate(self.placed)

    def apply_poses(self, poses: Poses) -> None:
        """Locate the object again, with the keyframes at these ``poses`` in ``map``."""
        self.placed = [seen.transformed(poses[seen.keyframe]) for seen in self.seen]
        self.ground = min(float(poses[seen.keyframe][2, 3]) for seen in self.seen)
        self.tried_at = list(AnchoredPlaces.joined(self.tried).at(poses))
        self.location = self.policy.locate(self.placed)

    def absorb(self, other: "Track") -> None:
        """Add the observations of a track that has turned out to be of the same object."""
        self.location = self.policy.joined(self, other)
        self.seen += other.seen
        self.placed += other.placed
        self.ground = min(self.ground, other.ground)
        self.missed = (self.missed | other.missed) - self.keyframes  # a keyframe that shows a part shows the object
        self.tried += other.tried
        self.tried_at += other.tried_at
        best = self.best_index
        for each in (self.seen, self.placed):
            each[:] = [o if k == best else replace(o, photo=o.photo[:0]) for k, o in enumerate(each)]

    @property
    def position(self) -> Place:
        """Position of the object's middle, m in ``map``."""
        return self.location.position

    @property
    def covariance(self) -> Covariance:
        """Covariance of the position."""
        return self.location.covariance

    @property
    def points(self) -> Points:
        """Points of the object."""
        return self.location.points

    @property
    def camera_positions(self) -> list[Place]:
        """Positions of the camera in the frames that show the object."""
        return [observation.camera for observation in self.placed]

    @property
    def keyframes(self) -> set[int]:
        """Indices of the keyframes that show the object."""
        return {observation.keyframe for observation in self.seen}

    @property
    def best_index(self) -> int:
        """Index of the observation whose photo shows the most."""
        return int(np.argmax([self.policy.photo_score(observation) for observation in self.seen]))

    @property
    def photo(self) -> Rgb:
        """The photo that shows the object best."""
        return self.seen[self.best_index].photo

    @property
    def times(self) -> list[float]:
        """Times of this run's frames that show the object, s, in ascending order."""
        return sorted({observation.time for observation in self.seen if np.isfinite(observation.time)})

    @property
    def text(self) -> str:
        """The text with the largest sum of confidences over the observations; empty if none could be read."""
        votes = defaultdict[str, float](float)
        for observation in self.seen:
            votes[observation.reading.text] += observation.reading.confidence if observation.reading.text else 0.0
        return max(votes, key=lambda text: (votes[text], text))

    @property
    def evidence(self) -> float:
        """Sum, over the keyframes that show the object, of the highest confidence of each keyframe's detections.

        Several detections in a keyframe may show the same part, so the others are no further evidence.
        """
        highest = defaultdict[int, float](float)
        for seen in self.seen:
            highest[seen.keyframe] = max(highest[seen.keyframe], seen.reading.confidence)
        return sum(highest.values())

    @property
    def confidence(self) -> float:
        """1 if the object was decoded; else the mean of the keyframes' highest confidences, with 0 for each miss."""
        return 1.0 if self.is_decoded else self.evidence / (len(self.keyframes) + len(self.missed))

    @property
    def baseline(self) -> float:
        """Greatest distance between two camera positions from which the object was seen, m."""
        each = np.array(self.camera_positions)
        return float(np.linalg.norm(each[:, None] - each[None], axis=2).max())

    @property
    def size(self) -> float:
        """Diagonal of a box with the extents of the object's points, m."""
        return float(np.linalg.norm(extents_of(self.points)))

    @property
    def has_depth(self) -> bool:
        """Whether any observation had depth."""
        return any(observation.has_depth for observation in self.seen)

    @property
    def is_decoded(self) -> bool:
        """Whether the object was decoded, and correctly according to its checksum."""
        return self.policy.has_checksum and bool(self.text)

    @property
    def is_given_up(self) -> bool:
        """Whether the object was missed too often; decoded objects are never given up."""
        return len(self.missed) > MAX_MISSES * len(self.keyframes) and not self.is_decoded

    @property
    def is_confirmed(self) -> bool:
        """Whether the object is certain enough to be reported."""
        least = self.policy.confirmation
        if not self.has_depth or (self.policy.has_checksum and not self.is_decoded):
            return False
        if least.misses is not None and len(self.missed) >= least.misses * len(self.keyframes):
            return False
        if self.evidence < least.evidence or self.confidence <= least.confidence:
            return False
        # Distances and sizes come last, because they take longest and this property is read several times a step.
        if self.baseline < least.baseline or (self.evidence < least.evidence_of_part and self.size < least.full_size):
            return False
        return self.policy.has_shape(self)

    def to_find(self) -> Find:
        """The find to report, with the time of this run's first frame of the object, or NaN without such a frame."""
        first, confidence = min(self.times, default=np.nan), min(1.0, self.confidence)
        return Find(self.policy.kind, self.text, self.position, self.covariance, first, confidence, self.photo)


def mahalanobis(one: Track, other: Track) -> float:
    """Squared Mahalanobis distance between the positions of two tracks."""
    apart = one.position - other.position
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))
