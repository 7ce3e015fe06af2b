"""The numbers by which people and finds are followed over frames."""

from dataclasses import dataclass
from math import log, radians


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """When a track is reported: of its detections each has a confidence from 0 to 1, and each miss one of 0.

    Attributes:
        confidence: the mean over detections and misses must be greater; at 0.5 it is likelier than not.
        evidence: least sum of the confidences.
        whole: m across; of most objects of the kind at least this much is seen, and less may be a part of anything.
        evidence_of_part: least sum of the confidences if less than ``whole`` is seen.
        misses: there must be fewer for each detection; None for any number.
        baseline: m, least distance between the farthest two places from which it was seen: from one place, the edge
            of an object may look like another object.
    """

    confidence: float = 0.0
    evidence: float = 0.0
    whole: float = 0.0
    evidence_of_part: float = 0.0
    misses: float | None = None
    baseline: float = 0.0


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """How one kind of object is followed.

    Attributes:
        confirmation: when a track is reported.
        misses: a track that was missed more often for each detection is given up.
        accepted: probability that two places of one object are near enough to be taken for one.
        across: m of the object that are to be in the image when it is looked at again.
        photo_margin: margin of a photo around the box of the object, as a share of the longer side.
    """

    confirmation: Confirmation
    misses: float = 2.0
    accepted: float = 0.99
    across: float
    photo_margin: float


@dataclass(frozen=True, kw_only=True)
class PeopleConfig(TrackConfig):
    """How people are followed.

    Attributes:
        evidence_to_look: least sum of the confidences for which a person who is not confirmed is worth a drive.
        touch: distance up to which two things touch, m: three times the error of a keyframe's pose.
        open_share: a person is in view if for this share of the points no return is nearer by more than ``touch``.
        voxel: m, edge of the voxels of a person.
        agreed: least share of the frames with a person that show a voxel of it.
        skin_to_middle: m, standard deviation due to the distance from the visible skin to the middle of the body.
    """

    confirmation: Confirmation = Confirmation(
        evidence=0.75, whole=0.85, evidence_of_part=1.2, misses=1.0, baseline=0.3
    )
    across: float = 0.85
    photo_margin: float = 0.2  # surroundings help to recognise a person
    evidence_to_look: float = 0.5
    touch: float = 0.15
    open_share: float = 0.7
    voxel: float = 0.03
    agreed: float = 0.2
    skin_to_middle: float = 0.08


@dataclass(frozen=True, kw_only=True)
class ObjectConfig(TrackConfig):
    """How a kind of signs, codes, objects or heat is followed.

    Attributes:
        across: m, the largest signs.
        readable: pixels along a side from which signs and codes are surely read: two for a module of a small QR code.
        nearer: least distance of another look, as a share of the nearest so far.
        same_side: rad around earlier lines of sight; from farther aside a sign is narrower, or not to be seen at all.
        sigmas: standard deviations of the position within which a return is of the object, not in front of it.
        gap: m of depth between an object and others in front of or behind it.
        pose_sigma: m, standard deviation of a keyframe's position: of trajectories in the benchmark's arenas.
        kept_voxel: m, edge of the voxels in each of which one of an observation's points is kept.
        of_person: distance from a person up to which a find belongs to that person, m.
    """

    confirmation: Confirmation = Confirmation(confidence=0.5)
    across: float = 0.3
    photo_margin: float = 0.5
    readable: float = 60.0
    nearer: float = 0.5
    same_side: float = radians(40)
    sigmas: float = 3.0
    gap: float = 0.3
    pose_sigma: float = 0.03
    kept_voxel: float = 0.025
    of_person: float = 0.0


SHAPE = ObjectConfig(confirmation=Confirmation(confidence=0.5, baseline=0.3), of_person=0.15)


Extents = tuple[float, float, float]
"""m, the longest first."""
WEIGHED = ("victim", "hazmat_sign", "fire_extinguisher", "door_lever")
"""Kinds that are weighed against background; what codes say needs no such check."""


@dataclass(frozen=True)
class LikelihoodConfig:
    """What objects measure, and what background does.

    Attributes:
        victim: medians of an object's extents; of people who stand or lie: stature, shoulder breadth, chest depth;
            who sit: sitting height, half of it and a thigh before them, shoulder breadth (NASA-STD-3000, section
            3.3); of dolls, as the RoboCup Rescue arena designer has them.
        hazmat_sign: the same of labels as the leagues print them, 0.1 to 0.3 m.
        fire_extinguisher: the same as the arena designer has them.
        door_lever: the same of levers with their plates.
        thinnest: m, noise of a depth camera at its usual range; nothing seems thinner.
        spread: standard deviation of an extent's logarithm: 95 % lie within a factor of 1.5.
        highest: m over the ground up to which people lie and stand, and signs hang; background is up to twice as high
            and long.
    """

    victim: tuple[Extents, ...] = ((1.7, 0.5, 0.25), (0.9, 0.7, 0.5), (0.45, 0.2, 0.14))
    hazmat_sign: tuple[Extents, ...] = ((0.2, 0.2, 0.02),)
    fire_extinguisher: tuple[Extents, ...] = ((0.45, 0.16, 0.14),)
    door_lever: tuple[Extents, ...] = ((0.22, 0.14, 0.06),)
    thinnest: float = 0.02
    spread: float = log(1.5) / 2
    highest: float = 2.0

    def extents(self, kind: str) -> tuple[Extents, ...]:
        """The extents, m, that objects of a kind may have; none of a kind that is not weighed."""
        return getattr(self, kind) if kind in WEIGHED else ()


@dataclass(frozen=True)
class ReobservationConfig:
    """What another look is worth, and from where.

    Attributes:
        reward: m² of unseen ground to which a viewpoint towards an object is equivalent.
        new_side: rad, least angle between a viewpoint and earlier ones, seen from the object, for the full reward. No
            viewpoint so near one that showed nothing has any: a person in a box is seen only from its open side.
        spacing: m; viewpoints that are nearer to each other show the same.
        most_tries: to see an object again.
        margin: m before the object at which the line of sight to it may end.
        beside_camera: m of a line of sight that count as free because the robot itself will stand there.
    """

    reward: float = 1.0
    new_side: float = radians(40)
    spacing: float = 0.3
    most_tries: int = 4
    margin: float = 0.3
    beside_camera: float = 0.3


@dataclass(frozen=True)
class TracksConfig:
    """How each kind is followed, and when it is looked at again.

    Attributes:
        likelihood: weighs what was seen against background.
        other: kinds of a reader of one's own.
    """

    victim: PeopleConfig = PeopleConfig()
    hazmat_sign: ObjectConfig = ObjectConfig()
    qr_code: ObjectConfig = ObjectConfig()
    april_tag: ObjectConfig = ObjectConfig()
    fire_extinguisher: ObjectConfig = SHAPE
    door_lever: ObjectConfig = SHAPE
    heat: ObjectConfig = ObjectConfig(of_person=0.4)
    other: ObjectConfig = ObjectConfig()
    likelihood: LikelihoodConfig = LikelihoodConfig()
    reobservation: ReobservationConfig = ReobservationConfig()
