"""Parameters of tracking people and finds over frames."""

from dataclasses import dataclass
from math import log, radians


@dataclass(frozen=True, kw_only=True)
class Confirmation:
    """When a track is reported; each detection has a confidence from 0 to 1, and each miss counts as 0.

    Attributes:
        confidence: the mean over detections and misses must exceed this; 0.5 means more likely real than not.
        evidence: minimum sum of the confidences.
        whole: size that is seen of most objects of the kind, m; something smaller may be a part of anything.
        evidence_of_part: minimum sum of the confidences if less than ``whole`` is seen.
        misses: maximum number of misses per detection, exclusive; None for no limit.
        baseline: minimum distance between the two camera positions farthest apart, m: from a single position, the
            edge of an object may look like another object.
    """

    confidence: float = 0.0
    evidence: float = 0.0
    whole: float = 0.0
    evidence_of_part: float = 0.0
    misses: float | None = None
    baseline: float = 0.0


Extents = tuple[float, float, float]
"""Three extents, the longest first, m."""


@dataclass(frozen=True, kw_only=True)
class TrackConfig:
    """How one kind of object is tracked.

    Attributes:
        confirmation: when a track is reported.
        misses: a track with more misses per detection than this is given up.
        accepted: probability that two measured positions of one object are close enough to be taken for one.
        across: width of the object that must be in the image when it is looked at again, m.
        photo_margin: margin of a photo around the object's box, as a share of the box's longer side.
        extents: median extents of the kind in the forms that it takes, m; without any, it is not weighed against
            background.
    """

    confirmation: Confirmation
    misses: float = 2.0
    accepted: float = 0.99
    across: float
    photo_margin: float
    extents: tuple[Extents, ...] = ()


@dataclass(frozen=True, kw_only=True)
class PeopleConfig(TrackConfig):
    """How people are tracked.

    Attributes:
        evidence_to_look: minimum sum of the confidences for which an unconfirmed person is worth a drive.
        touch: maximum distance between two sets of points that touch, m: three times the error of a keyframe's pose.
        open_share: a person is in view if, at more than this share of the person's points, there is a return that is
            not nearer by ``touch`` or more.
        voxel: edge length of a person's voxels, m.
        agreed: minimum share of the keyframes showing a person that must show a voxel for it to count.
        skin_to_middle: standard deviation due to the distance from the visible skin to the middle of the body, m.
        extents: of standing or lying people, stature, shoulder breadth and chest depth; of sitting people, sitting
            height, depth including the thighs, and shoulder breadth (NASA-STD-3000, section 3.3); of dolls, as in the
            RoboCup Rescue arena designer.
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
    extents: tuple[Extents, ...] = ((1.7, 0.5, 0.25), (0.9, 0.7, 0.5), (0.45, 0.2, 0.14))


@dataclass(frozen=True, kw_only=True)
class ObjectConfig(TrackConfig):
    """How one kind of sign, code, object or heat is tracked.

    Attributes:
        across: width of the largest signs, m.
        readable: side length from which signs and codes are surely read, pixels: two per module of a small QR code.
        nearer: minimum distance of another look, as a share of the nearest so far.
        same_side: maximum angle to an earlier line of sight, rad; from farther to the side, a sign looks narrower, or
            cannot be seen at all.
        sigmas: a return is of the object, not in front of it, within this many standard deviations of its position.
        gap: difference in depth between an object and others in front of or behind it, m.
        pose_sigma: standard deviation of a keyframe's position, m, from trajectories in the benchmark's arenas.
        kept_voxel: edge length of voxels, m, in each of which one point of an observation is kept.
        of_person: maximum distance from a person at which a find belongs to that person, m.
        is_flat: whether it shows the same from all directions.
        has_checksum: whether it is decoded correctly or not at all.
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
    is_flat: bool = False
    has_checksum: bool = False


@dataclass(frozen=True)
class LikelihoodConfig:
    """How sizes of objects and of background are distributed.

    Attributes:
        thinnest: noise of a depth camera at its usual range, m; nothing seems thinner.
        spread: standard deviation of an extent's logarithm: 95 % lie within a factor of 1.5.
        highest: maximum height above the ground of people and signs, m; background is up to twice as high and long.
    """

    thinnest: float = 0.02
    spread: float = log(1.5) / 2
    highest: float = 2.0


@dataclass(frozen=True)
class ReobservationConfig:
    """What another look is worth, and from where.

    Attributes:
        reward: area of unseen ground to which a viewpoint towards an object is equivalent, m².
        new_side: minimum angle between a viewpoint and earlier ones, as seen from the object, for the full reward,
            rad. Within this angle of one that showed nothing, there is no reward: a person in a box is seen only from
            its open side.
        spacing: viewpoints closer together than this show the same, m.
        most_tries: maximum number of tries to see an object again.
        margin: distance before the object at which the line of sight to it may end, m.
        beside_camera: length at the start of a line of sight that counts as free, m, since the robot will be there.
    """

    reward: float = 1.0
    new_side: float = radians(40)
    spacing: float = 0.3
    most_tries: int = 4
    margin: float = 0.3
    beside_camera: float = 0.3


@dataclass(frozen=True)
class TracksConfig:
    """How each kind is tracked, and when it is looked at again.

    Attributes:
        heat: settings for warm regions.
        other: settings for the kinds of readers that bring none of their own.
        likelihood: used to weigh what was seen against background.
    """

    victim: PeopleConfig = PeopleConfig()
    heat: ObjectConfig = ObjectConfig(of_person=0.4)
    other: ObjectConfig = ObjectConfig()
    likelihood: LikelihoodConfig = LikelihoodConfig()
    reobservation: ReobservationConfig = ReobservationConfig()
