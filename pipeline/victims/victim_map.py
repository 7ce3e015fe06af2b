"""Victims on the map: the observations of each, and whether they suffice to confirm it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.geometry.moving_kernels import moved
from pipeline.keyframes import Places
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.sensor import SensorModel
from pipeline.tracks.find import VICTIM
from pipeline.tracks.likelihood import weigh
from pipeline.tracks.observation import photo_of
from pipeline.tracks.sought import apart
from pipeline.transforms import inverse, transform_points
from pipeline.victims.detection.detection import Detection
from pipeline.victims.observation import SKIN_TO_MIDDLE, PersonObservation, Refusal, middle, observe, size_of
from pipeline.victims.person_voxels import PersonVoxels

TOUCH = 0.15
"""m; what is no farther apart touches: three times the error of a keyframe's pose."""
REOBSERVED = 0.5
"""Least sum of the confidences of a victim's detections for which a re-observation is worth the drive."""
ENOUGH, ENOUGH_OF_PART = 0.75, 1.2
"""Least sum of confidences of a confirmed victim, and of a confirmed victim of which less than WHOLE is seen."""
WHOLE = 0.85  # m across; of most people at least this much is seen, and less may be a part of any object
OPEN_SHARE = 0.7
"""A victim is in view if for this share of its points the return is nearer by no more than TOUCH."""
PHOTO_MARGIN = 0.2
"""Margin of a photo around its box, as a share of the longer side: surroundings help to recognise a person."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """One observation of a person, in ``base_link`` of its keyframe or, placed, in ``map``.

    Attributes:
        keyframe: number of its keyframe.
        points: (N, 3) float32 the person's points, m.
        information: (3, 3) float64 inverse of the position's covariance, 1/m².
        camera: (3,) float64 position of the camera, m.
        time: of the frame, s; NaN in the map of an earlier episode.
    """

    keyframe: int
    points: NDArray[np.float32]
    information: NDArray[np.float64]
    camera: NDArray[np.float64]
    time: float = np.nan

    def moved(self, T: NDArray[np.float64]) -> "Sighting":
        """The same observation moved by the 4×4 transform ``T``."""
        R = T[:3, :3]
        camera, information = R @ self.camera + T[:3, 3], R @ self.information @ R.T
        return Sighting(self.keyframe, moved(T, self.points), information, camera, self.time)


@dataclass(eq=False)
class Victim:
    """A person on the map, confirmed or not.

    Attributes:
        voxels: where it is, by all of its sightings.
        information: (3, 3) float64 inverse of the position's covariance, 1/m².
        cameras: (3,) float64 each, positions of the camera in the frames that show the person.
        confidences: of the detections in these frames.
        photo: (h, w, 3) uint8 of the detection that shows most of the person, weighted by its confidence.
        photo_shows: number of the person's voxels in the photo, times the detection's confidence.
        missed: number of frames with the person in view but without a detection of it.
        tried: the places on the ground from which the person was to be re-observed, one each.
        tried_at: (3,) float64 each, these places, m in ``map``.
        sightings: the observations of which voxels and information are made, relative to their keyframes.
        ground: height of the lowest ground from which the person was seen, m in ``map``.
    """

    voxels: PersonVoxels
    information: NDArray[np.float64]
    cameras: list[NDArray[np.float64]]
    confidences: list[float]
    photo: NDArray[np.uint8]
    photo_shows: float = 0.0
    missed: int = 0
    tried: list[Places] = field(default_factory=list)
    tried_at: list[NDArray[np.float64]] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    ground: float = 0.0

    @property
    def across(self) -> float:
        """m of a person that are to be in the image."""
        return WHOLE

    @property
    def is_flat(self) -> bool:
        """A person looks different from another side."""
        return False

    def distances(self, sensor: SensorModel) -> tuple[float, float]:
        """Least and greatest distance, m, from which a person is whole in the image."""
        return sensor.nearest + WHOLE / 2, farthest_whole(sensor)

    def take(self, other: "Victim") -> None:
        """Add where another victim is that is the same person."""
        self.voxels = PersonVoxels.joined([self.voxels, other.voxels])
        self.information = _joined(self.information, other.information)

    def place(self, poses: NDArray[np.float64]) -> None:
        """Make it anew of its sightings, with the keyframes at (K, 4, 4) poses in ``map``."""
        self.tried_at = list(Places.joined(self.tried).at(poses))
        placed = [seen.moved(poses[seen.keyframe]) for seen in self.sightings]
        self.voxels = PersonVoxels.joined([PersonVoxels.of(seen.points) for seen in placed])
        self.information = reduce(_joined, [seen.information for seen in placed])
        self.ground = min(float(poses[seen.keyframe][2, 3]) for seen in self.sightings)
        self.cameras = [seen.camera for seen in placed]

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the person, m in ``map``."""
        return self.voxels.agreed(len({seen.keyframe for seen in self.sightings}))

    def in_frame(self, keyframe: int) -> NDArray[np.float32]:
        """(N, 3) float32 points that a keyframe shows, m in its ``base_link``; it must show some."""
        return np.concatenate([seen.points for seen in self.sightings if seen.keyframe == keyframe])

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) float64 middle of the points, m in ``map``."""
        return middle(self.points)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3) float64 of the position, m²."""
        return _inverse(self.information)

    @property
    def confidence(self) -> float:
        """Mean confidence over the detections and the missed frames; a missed frame counts as 0."""
        return self.evidence / (len(self.confidences) + self.missed)

    @property
    def evidence(self) -> float:
        """Sum of the confidences of all detections."""
        return sum(self.confidences)

    @property
    def size(self) -> float:
        """Size of the points, m, by :func:`size_of`."""
        return size_of(self.points)

    @property
    def apart(self) -> float:
        """m between the farthest two places from which the person was found."""
        return apart(self.cameras)


class Victims:
    """All victims, confirmed or not.

    Attributes:
        all: in the order in which they were found, also victims with little evidence.
        refusals: detections of the last frame that are no person.
    """

    def __init__(self) -> None:
        self.all: list[Victim] = []
        self.refusals: list[Refusal] = []

    @property
    def confirmed(self) -> list[Victim]:
        """The victims for which :meth:`is_confirmed` holds."""
        return [victim for victim in self.all if self.is_confirmed(victim)]

    @property
    def unconfirmed(self) -> list[Victim]:
        """The victims that are worth a re-observation from elsewhere."""
        return [victim for victim in self.suspected if not self.is_confirmed(victim)]

    @property
    def suspected(self) -> list[Victim]:
        """The victims that are worth a re-observation if they are not confirmed."""
        return [victim for victim in self.all if victim.evidence >= REOBSERVED]

    @staticmethod
    def is_confirmed(victim: Victim) -> bool:
        """Whether it has enough detections from places far enough apart, enough evidence, and fewer misses.

        All that was seen of it must have the shape of a person; one of whom little is seen needs more evidence.
        """
        found = len(victim.cameras)
        if found <= victim.missed or victim.evidence < ENOUGH:
            return False
        # Distances and sizes come last: they take longest, and this is called several times a step.
        if victim.apart < KEYFRAME_WAY or (victim.evidence < ENOUGH_OF_PART and victim.size < WHOLE):
            return False
        return _is_person(victim.points, victim.ground)

    def place(self, poses: NDArray[np.float64]) -> None:
        """Make all victims anew at (K, 4, 4) keyframes in ``map``, and join those that prove to be one person."""
        for victim in self.all:
            victim.place(poses)
        self._merge()

    def update(
        self, frame: Frame, detections: Sequence[Detection], T_map_camera: NDArray[np.float64], keyframe: int = 0
    ) -> None:
        """Add the observations of a frame's detections, and count a miss for each victim in view without a detection.

        Args:
            frame: with its depth.
            detections: in its image; may be empty; those of other kinds are ignored.
            T_map_camera: 4×4 pose of ``camera_optical`` in ``map``.
            keyframe: number of the frame's keyframe.
        """
        seen = [observe(frame, detection, T_map_camera) for detection in detections if detection.kind == VICTIM]
        self.refusals = [item for item in seen if isinstance(item, Refusal)]
        T_map_base = T_map_camera @ inverse(frame.T_base_camera)
        before, found = list(self.all), set[int]()
        for observation in (item for item in seen if isinstance(item, PersonObservation)):
            found.add(id(self._add(_victim_of(observation, frame, keyframe, T_map_base))))
        for victim in before:
            if id(victim) not in found and _in_view(victim, frame, T_map_camera):
                victim.missed += 1
        self._merge()
        self.all = [victim for victim in self.all if victim.missed <= 2 * len(victim.cameras)]

    def _same(self, new: Victim) -> list[Victim]:
        """The victims that may be the same person."""
        near = [o for o in self.all if _distance(o, new) <= chi2_gate(3) or _touch(o.points, new.points)]
        return [other for other in near if not _are_seen_apart(other, new)]

    def _add(self, new: Victim) -> Victim:
        """Add to the nearest victim that may be the same person, or as a new one; that which it is."""
        same = self._same(new)
        if not same:
            self.all.append(new)
            return new
        nearest = min(same, key=lambda other: _distance(other, new))
        self._join(nearest, new)
        return nearest

    def _join(self, victim: Victim, other: Victim) -> None:
        """Add to a victim the data of another victim that is the same person."""
        if other.photo_shows > victim.photo_shows:
            victim.photo, victim.photo_shows = other.photo, other.photo_shows
        victim.take(other)
        victim.ground = min(victim.ground, other.ground)
        victim.sightings += other.sightings
        victim.cameras += other.cameras
        victim.confidences += other.confidences
        victim.missed = min(victim.missed, other.missed)
        victim.tried += other.tried
        victim.tried_at += other.tried_at

    def _merge(self) -> None:
        """Join victims that have turned out to be parts of one person."""
        kept: list[Victim] = []
        for victim in self.all:
            near = next((other for other in kept if _is_one(other, victim)), None)
            if near is not None:
                self._join(near, victim)
            else:
                kept.append(victim)
        self.all = kept


def _victim_of(
    observation: PersonObservation, frame: Frame, keyframe: int, T_map_base: NDArray[np.float64]
) -> Victim:
    """A person of whom this is all that is known."""
    points, confidence = PersonVoxels.of(observation.points).seen, observation.detection.confidence
    seen = Sighting(keyframe, points, _inverse(observation.covariance), observation.camera, frame.time)
    seen = seen.moved(inverse(T_map_base))
    photo = photo_of(frame.rgb, observation.detection.box, PHOTO_MARGIN)
    # Of what is kept, so that a map made anew is the same.
    now = seen.moved(T_map_base)
    return Victim(
        voxels=PersonVoxels.of(now.points),
        information=now.information,
        cameras=[now.camera],
        confidences=[confidence],
        photo=photo,
        photo_shows=len(points) * confidence,
        sightings=[seen],
        ground=float(T_map_base[2, 3]),
    )


def _distance(one: Victim, other: Victim) -> float:
    """Squared Mahalanobis distance of two victims' positions."""
    apart = one.position - other.position
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))


def _is_one(one: Victim, other: Victim) -> bool:
    """Whether two victims are one person: they touch, and no frame shows them apart."""
    return _touch(one.points, other.points) and not _are_seen_apart(one, other)


def _touch(one: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether the nearest of (N, 3) and (M, 3) points are at most TOUCH apart."""
    small, large = sorted((one, other), key=len)
    return bool(cKDTree(small).query(large, distance_upper_bound=TOUCH)[0].min() <= TOUCH)


def _are_seen_apart(one: Victim, other: Victim) -> bool:
    """Whether a frame shows both, and there they do not touch: two people, however near."""
    frames = {seen.keyframe for seen in one.sightings} & {seen.keyframe for seen in other.sightings}
    return any(not _touch(one.in_frame(keyframe), other.in_frame(keyframe)) for keyframe in frames)


def _is_person(points: NDArray[np.float32], ground: float) -> bool:
    """Whether all that was seen (N, 3), together, is more like a person than like background."""
    return weigh(VICTIM, points, ground).log_ratio > 0


def farthest_whole(sensor: SensorModel) -> float:
    """m; a person in the camera's range is no farther than this."""
    return sensor.farthest - WHOLE / 2


def _in_view(victim: Victim, frame: Frame, T_map_camera: NDArray[np.float64]) -> bool:
    """Whether the victim is near enough and most of its points lie in the image with nothing in front of them."""
    points = transform_points(inverse(T_map_camera), victim.points)
    depth = np.maximum(points[:, 2], 1e-6)
    if np.median(depth) > farthest_whole(frame.sensor):
        return False
    pixels, inside = frame.intrinsics.project(points)
    depth, (row, column) = depth[inside], pixels[inside].T
    measured = frame.depth[row, column]
    is_open = (measured > 0) & (measured > depth - TOUCH)
    return bool(is_open.sum() > OPEN_SHARE * len(points))


def _joined(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) information of both; errors of what one place shows are correlated, so the covariance has a floor."""
    return _inverse(_inverse(one + other) + np.eye(3) * (SKIN_TO_MIDDLE / 2) ** 2)


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.inv(matrix).astype(np.float64)
