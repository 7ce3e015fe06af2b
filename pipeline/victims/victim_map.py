"""Victims on the map: what was seen of each from where, and whether that is enough to confirm one."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.localisation.correction import Correction, moved_by
from pipeline.transforms import inverse, transform_points
from pipeline.victims.detection.background import depth_noise
from pipeline.victims.detection.detection import Detection
from pipeline.victims.observation import MAX_SIZE, SKIN_TO_MIDDLE, Observation, Refusal, middle, observe, size_of

GATE = 11.34
"""Largest squared Mahalanobis distance of an observation from its victim: 99 % (χ², three degrees of freedom)."""
TOGETHER = 1.85
"""m across; 24 people in 25 measure no more, and few pairs of people who lie side by side do not."""
BETWEEN = 0.4
"""m at most between two parts that are one person if both together measure no more than TOGETHER: two ends are seen
of a person whose middle is hidden, or of whom one frame shows the legs and another one the head."""
TOUCH, INSIDE = 0.15, 0.5
"""Two parts are one person, even if they measure more, if the share INSIDE of the smaller one's points lies within
TOUCH, m, of the other's."""
REOBSERVED = 0.5
"""Sum of the confidences of a victim's detections from which on re-observation is worth the drive."""
ENOUGH, ENOUGH_OF_PART = 0.75, 1.2
"""The same, from which on a victim is confirmed, and one of which less than WHOLE is seen."""
WHOLE = 0.85  # m across what is seen of most people, at least; less may be a part of anything
MIN_FRAMES, APART = 2, 0.3
"""Detections of a victim before it is confirmed, and m between the farthest two cameras of these, at least."""
IN_VIEW = 3.0  # m within which a victim that is not hidden ought to be detected again
OPEN_SHARE, CLEARANCE = 0.7, 0.1
"""A victim counts as seen if for this share of its points no return is nearer by CLEARANCE, m, and the noise."""
VOXEL = 0.03  # m; one of a victim's points is kept in each voxel
PHOTO_MARGIN = 0.2
"""Margin of a photo around its box, as a share of the longer side: surroundings help to recognise a person."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """One observation of a person, in ``map`` as it was then.

    Attributes:
        keyframe: in which that was.
        points: (N, 3) float32 what was seen, m.
        information: (3, 3) float64 inverse of the position's covariance, 1/m².
        camera: (3,) float64 where the camera stood, m.
        time: of the frame, s; NaN in the map of an earlier episode.
    """

    keyframe: int
    points: NDArray[np.float32]
    information: NDArray[np.float64]
    camera: NDArray[np.float64]
    time: float = np.nan

    def moved(self, T: NDArray[np.float64]) -> "Sighting":
        """The same after the map has moved by the 4×4 transform ``T``."""
        R, points = T[:3, :3], moved_by(T, self.points).astype(np.float32)
        camera = moved_by(T, self.camera[None])[0]
        return Sighting(self.keyframe, points, R @ self.information @ R.T, camera, self.time)


@dataclass(eq=False)
class Victim:
    """A person on the map, confirmed or not.

    Attributes:
        points: (N, 3) float32 all that was seen of the person, m in ``map``.
        information: (3, 3) float64 inverse of the position's covariance, 1/m².
        cameras: (3,) float64 each, where the camera stood when it found the person.
        confidences: of these detections.
        photo: (h, w, 3) uint8 of the detection that shows most of the person, weighed by its confidence.
        photo_shows: voxels of the person that it shows, times its confidence.
        missed: frames that showed the place, not hidden, without a detection there.
        tried: (3,) float64 each, the places on the ground from which the person was to be re-observed.
        sightings: the observations that points and information are made of.
    """

    points: NDArray[np.float32]
    information: NDArray[np.float64]
    cameras: list[NDArray[np.float64]]
    confidences: list[float]
    photo: NDArray[np.uint8]
    photo_shows: float = 0.0
    missed: int = 0
    tried: list[NDArray[np.float64]] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)

    def take(self, seen: "Sighting | Victim") -> None:
        """Add what one more observation shows, or several of the same person, to points and information."""
        self.points = _thinned(np.concatenate([self.points, seen.points]))
        # Observations from one place err alike: a victim is never more certain than the best of them by much.
        floor = np.eye(3) * SKIN_TO_MIDDLE**2 / 4
        self.information = _inverse(_inverse(self.information + seen.information) + floor)

    def correct(self, correction: Correction, motions: NDArray[np.float64]) -> None:
        """Make it anew of its sightings, moved by the (N, 4, 4) motions of all keyframes since they were added."""
        self.tried = list(correction.moved(np.reshape(self.tried, (-1, 3))))
        first, *others = (seen.moved(motions[seen.keyframe]) for seen in self.sightings)
        self.points, self.information = first.points, first.information
        for seen in others:
            self.take(seen)
        self.cameras = [seen.camera for seen in (first, *others)]

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) float64 middle of what was seen, m in ``map``."""
        return middle(self.points)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3) float64 of the position, m²."""
        return _inverse(self.information)

    @property
    def confidence(self) -> float:
        """Mean over the frames that ought to have found the person, 0 for those that did not."""
        return self.evidence / (len(self.confidences) + self.missed)

    @property
    def evidence(self) -> float:
        """Sum of the confidences of all detections."""
        return sum(self.confidences)

    @property
    def size(self) -> float:
        """m across what was seen, as :func:`size_of` has it."""
        return size_of(self.points)

    @property
    def apart(self) -> float:
        """m between the farthest two places from which the person was found."""
        cameras = np.array(self.cameras)
        return float(np.linalg.norm(cameras[:, None] - cameras[None], axis=2).max())


class Victims:
    """All victims that were seen, confirmed or not.

    Attributes:
        all: in the order in which they were found, also those of little evidence.
        refusals: detections of the last frame that are no person.
    """

    def __init__(self) -> None:
        self.all: list[Victim] = []
        self.refusals: list[Refusal] = []

    @property
    def confirmed(self) -> list[Victim]:
        """Those for which :meth:`is_confirmed` holds."""
        return [victim for victim in self.all if self.is_confirmed(victim)]

    @property
    def unconfirmed(self) -> list[Victim]:
        """Those that are worth observing again from elsewhere."""
        return [v for v in self.all if v.evidence >= REOBSERVED and not self.is_confirmed(v)]

    @staticmethod
    def is_confirmed(victim: Victim) -> bool:
        """Whether it was found often and surely enough, from different places, and more often than missed.

        The less is seen of it, the more evidence it takes.
        """
        found = len(victim.cameras)
        if found < MIN_FRAMES or found <= victim.missed or victim.evidence < ENOUGH:
            return False
        # Distances and sizes come last: they take longest, and this is asked several times a step.
        return victim.apart >= APART and (victim.evidence >= ENOUGH_OF_PART or victim.size >= WHOLE)

    def correct(self, correction: Correction, motions: NDArray[np.float64]) -> None:
        """Let all victims follow the poses of the keyframes that showed them, and join those that turn out to be one.

        ``motions`` (N, 4, 4) of the keyframes lead from ``map`` as it was when each was added to ``map`` as it is.
        """
        for victim in self.all:
            victim.correct(correction, motions)
        self._merge()

    def update(
        self, frame: Frame, detections: Sequence[Detection], T_map_camera: NDArray[np.float64], keyframe: int = 0
    ) -> None:
        """Add what a frame's detections and depth show, and count the victims that it ought to show and does not.

        Args:
            frame: with its depth.
            detections: in its image; maybe none.
            T_map_camera: 4×4 pose of ``camera_optical`` in ``map``.
            keyframe: whose frame it is.
        """
        seen = [observe(frame, detection, T_map_camera) for detection in detections]
        self.refusals = [item for item in seen if isinstance(item, Refusal)]
        before, found = list(self.all), set[int]()
        for observation in (item for item in seen if isinstance(item, Observation)):
            found.add(id(self._add(observation, frame, keyframe)))
        for victim in before:
            if id(victim) not in found and _in_view(victim, frame, T_map_camera):
                victim.missed += 1
        self._merge()
        self.all = [victim for victim in self.all if victim.missed <= 2 * len(victim.cameras)]

    def _add(self, observation: Observation, frame: Frame, keyframe: int) -> Victim:
        """Add an observation to the nearest victim that may be the same person, or as a new one."""
        points, confidence = _thinned(observation.points), observation.detection.confidence
        seen = Sighting(keyframe, points, _inverse(observation.covariance), observation.camera, frame.time)
        photo = _crop(frame.rgb, observation.detection.box)
        new = Victim(
            points, seen.information, [seen.camera], [confidence], photo, len(points) * confidence, sightings=[seen]
        )
        same = [other for other in self.all if _distance(other, new) <= GATE or _is_one(other, new)]
        if not same:
            self.all.append(new)
            return new
        nearest = min(same, key=lambda other: _distance(other, new))
        self._join(nearest, new)
        return nearest

    def _join(self, victim: Victim, other: Victim) -> None:
        """Add to a victim what is known of another one, which is the same person."""
        if other.photo_shows > victim.photo_shows:
            victim.photo, victim.photo_shows = other.photo, other.photo_shows
        victim.take(other)
        victim.sightings += other.sightings
        victim.cameras += other.cameras
        victim.confidences += other.confidences
        victim.missed = min(victim.missed, other.missed)
        victim.tried += other.tried

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


def _distance(one: Victim, other: Victim) -> float:
    """Squared Mahalanobis distance of two positions."""
    apart = one.position - other.position
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))


def _is_one(one: Victim, other: Victim) -> bool:
    """Whether one lies where the other does, or so near that both together are one person."""
    small, large = sorted((one.points, other.points), key=len)
    together = size_of(np.concatenate([small, large]))
    if together > MAX_SIZE:
        return False
    apart, _ = cKDTree(large).query(small)
    if together <= TOGETHER:
        return bool(apart.min() <= BETWEEN)
    return bool((apart <= TOUCH).mean() >= INSIDE)


def _in_view(victim: Victim, frame: Frame, T_map_camera: NDArray[np.float64]) -> bool:
    """Whether most of a victim's points lie in the image, near enough, with nothing before them."""
    points = transform_points(inverse(T_map_camera), victim.points)
    depth = np.maximum(points[:, 2], 1e-6)
    if np.median(depth) > IN_VIEW:
        return False
    pixels, inside = frame.intrinsics.project(points)
    depth, (row, column) = depth[inside], pixels[inside].T
    measured = frame.depth[row, column]
    is_open = (measured > 0) & (measured > depth - CLEARANCE - 2 * depth_noise(depth))
    return bool(is_open.sum() > OPEN_SHARE * len(points))


def _thinned(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """One point of each voxel."""
    _, first = np.unique(np.floor(points / VOXEL).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.inv(matrix).astype(np.float64)


def _crop(rgb: NDArray[np.uint8], box: tuple[float, float, float, float]) -> NDArray[np.uint8]:
    """The picture in a box and a margin."""
    x0, y0, x1, y1 = box
    more = PHOTO_MARGIN * max(x1 - x0, y1 - y0)
    rows = slice(max(0, int(y0 - more)), int(np.ceil(y1 + more)))
    return rgb[rows, max(0, int(x0 - more)) : int(np.ceil(x1 + more))].copy()
