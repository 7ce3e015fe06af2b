"""Victims on the map: what was seen of each from where, and whether that is enough to report one."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.transforms import inverse, transform_points
from pipeline.victims.detection.background import depth_noise
from pipeline.victims.detection.detection import Detection
from pipeline.victims.observation import (
    Observation,
    ObservationConfig,
    Refusal,
    middle,
    observe,
    size_of,
)


@dataclass(frozen=True)
class VictimsConfig:
    """Settings of the victims on the map.

    Attributes:
        observation: what counts as a person.
        gate: largest squared Mahalanobis distance of an observation from the victim that it may be of; 11.34 holds
            99 % of them (χ² of three degrees of freedom).
        together: m across; 24 people in 25 measure no more, and few who lie side by side do not.
        between: m at most between two who are one if both measure no more than ``together``: of someone whose middle
            is hidden, or of whom one look shows the legs and another one the head, two ends are seen.
        touch: m within which points of two touch.
        inside: share of the points of the smaller of two that touch the other's, from which on they are one even if
            they measure more.
        worth_a_look: sum of the confidences of all detections of someone from which on a second look is worth while.
        enough: the same, from which on someone is confirmed.
        whole: m across what is seen of most people, at least; less may be a part of anything.
        enough_of_part: the sum from which on someone is confirmed of whom less is seen.
        steps: at least, that found a victim before it is confirmed.
        apart: m at least between the farthest two places of these looks.
        in_view: m within which someone who is not hidden ought to be found again.
        voxel: m, of which one point of a victim is kept.
    """

    observation: ObservationConfig = field(default_factory=ObservationConfig)
    gate: float = 11.34
    together: float = 1.85
    between: float = 0.4
    touch: float = 0.15
    inside: float = 0.5
    worth_a_look: float = 0.5
    enough: float = 0.75
    whole: float = 0.85
    enough_of_part: float = 1.2
    steps: int = 2
    apart: float = 0.3
    in_view: float = 3.0
    voxel: float = 0.03


@dataclass(eq=False)
class Victim:
    """Someone on the map.

    Attributes:
        points: (N, 3) float32 all that was seen of the person, in ``map``.
        information: (3, 3) inverse of the position's covariance, 1/m².
        cameras: where the camera stood when the person was found.
        confidences: of these detections.
        photo: (h, w, 3) uint8 of the detection that shows most of the person, weighed by its confidence.
        photo_shows: voxels of the person that it shows, times its confidence.
        missed: looks that showed the place, not hidden, without finding anyone there.
        tried: where the camera was to be at second looks that were meant for the person.
    """

    points: NDArray[np.float32]
    information: NDArray[np.float64]
    cameras: list[NDArray[np.float64]]
    confidences: list[float]
    photo: NDArray[np.uint8]
    photo_shows: float = 0.0
    missed: int = 0
    tried: list[NDArray[np.float64]] = field(default_factory=list)

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) middle of what was seen."""
        return middle(self.points)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3) of the position, m²."""
        return _inverse(self.information)

    @property
    def extent(self) -> NDArray[np.float64]:
        """(3,) m along x, y and z of what was seen."""
        return np.ptp(self.points.astype(np.float64), axis=0)

    @property
    def confidence(self) -> float:
        """Mean over the looks that ought to have found the person, 0 for those that did not."""
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
        all: in the order in which they were found, with those of whom too little tells.
        refusals: detections of the last look that are no person.
    """

    def __init__(self, config: VictimsConfig | None = None) -> None:
        """None yet."""
        self.config = config or VictimsConfig()
        self.all: list[Victim] = []
        self.refusals: list[Refusal] = []

    @property
    def confirmed(self) -> list[Victim]:
        """Those of whom :meth:`is_confirmed` holds."""
        return [victim for victim in self.all if self.is_confirmed(victim)]

    @property
    def unconfirmed(self) -> list[Victim]:
        """Those worth a second look from elsewhere."""
        return [v for v in self.all if v.evidence >= self.config.worth_a_look and not self.is_confirmed(v)]

    def is_confirmed(self, victim: Victim) -> bool:
        """Whether it was found often and surely enough, from different places, and more often than missed.

        If little is seen of it, it takes more to be sure enough.
        """
        config, found = self.config, len(victim.cameras)
        if found < config.steps or found <= victim.missed or victim.evidence < config.enough:
            return False
        # Distances and sizes come last: they take longest, and everyone is asked about several times a look.
        return victim.apart >= config.apart and (
            victim.evidence >= config.enough_of_part or victim.size >= config.whole
        )

    def update(
        self, frame: Frame, detections: Sequence[Detection], T_map_camera: NDArray[np.float64]
    ) -> None:
        """Add what a look at ``T_map_camera`` has found; of none, that it found none."""
        seen = [observe(frame, d, T_map_camera, self.config.observation) for d in detections]
        self.refusals = [item for item in seen if isinstance(item, Refusal)]
        before, found = list(self.all), set[int]()
        for observation in (item for item in seen if isinstance(item, Observation)):
            found.add(id(self._add(observation, frame)))
        for victim in before:
            if id(victim) not in found and self._in_view(victim, frame, T_map_camera):
                victim.missed += 1
        self._merge()
        self.all = [victim for victim in self.all if victim.missed <= 2 * len(victim.cameras)]

    def _add(self, observation: Observation, frame: Frame) -> Victim:
        """To the nearest victim who may be the same, or as a new one."""
        points, confidence = self._thinned(observation.points), observation.detection.confidence
        new = Victim(
            points,
            _inverse(observation.covariance),
            [observation.camera],
            [confidence],
            _crop(frame.rgb, observation.detection.box),
            len(points) * confidence,
        )
        near = self._same(new, self.all)
        if near is None:
            self.all.append(new)
            return new
        self._join(near, new)
        return near

    def _same(self, victim: Victim, others: Sequence[Victim]) -> Victim | None:
        """The nearest of those who may be the same person; None if nobody may."""
        near = [o for o in others if self._distance(o, victim) <= self.config.gate or self._is_one(o, victim)]
        return min(near, key=lambda other: self._distance(other, victim), default=None)

    def _distance(self, one: Victim, other: Victim) -> float:
        """Squared Mahalanobis distance of two positions."""
        apart = one.position - other.position
        return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))

    def _is_one(self, one: Victim, other: Victim) -> bool:
        """Whether one lies where the other does, or so near that both together are one person."""
        config = self.config
        small, large = sorted((one.points, other.points), key=len)
        together = size_of(np.concatenate([small, large]))
        if together > config.observation.max_size:
            return False
        apart, _ = cKDTree(large).query(small)
        if together <= config.together:
            return bool(apart.min() <= config.between)
        return bool((apart <= config.touch).mean() >= config.inside)

    def _join(self, victim: Victim, other: Victim) -> None:
        """Add to a victim what is known of another, who is the same."""
        if other.photo_shows > victim.photo_shows:
            victim.photo, victim.photo_shows = other.photo, other.photo_shows
        victim.points = self._thinned(np.concatenate([victim.points, other.points]))
        # Looks from one place err alike: a victim is never more certain than the best of them by much.
        floor = np.eye(3) * self.config.observation.skin_to_middle**2 / 4
        joint = _inverse(victim.information + other.information)
        victim.information = _inverse(joint + floor)
        victim.cameras += other.cameras
        victim.confidences += other.confidences
        victim.missed = min(victim.missed, other.missed)
        victim.tried += other.tried

    def _merge(self) -> None:
        """Join victims that have grown together: of someone seen in parts."""
        kept: list[Victim] = []
        for victim in self.all:
            near = next((other for other in kept if self._is_one(other, victim)), None)
            if near is not None:
                self._join(near, victim)
            else:
                kept.append(victim)
        self.all = kept

    def _in_view(self, victim: Victim, frame: Frame, T_map_camera: NDArray[np.float64]) -> bool:
        """Whether most of a victim's points lie in the image, near enough, with nothing before them."""
        points = transform_points(inverse(T_map_camera), victim.points)
        k = frame.intrinsics
        depth = np.maximum(points[:, 2], 1e-6)
        u = np.floor(points[:, 0] / depth * k.fx + k.cx).astype(int)
        v = np.floor(points[:, 1] / depth * k.fy + k.cy).astype(int)
        inside = (points[:, 2] > 0) & (u >= 0) & (u < k.width) & (v >= 0) & (v < k.height)
        if np.median(depth) > self.config.in_view:
            return False
        measured = frame.depth[v[inside], u[inside]]
        open_view = (measured > 0) & (measured > depth[inside] - 0.1 - 2 * depth_noise(depth[inside]))
        return bool(open_view.sum() > 0.7 * len(points))

    def _thinned(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """One point of each voxel."""
        voxels = np.floor(points / self.config.voxel).astype(np.int64)
        _, first = np.unique(voxels, axis=0, return_index=True)
        return points[np.sort(first)]


def _inverse(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.inv(matrix).astype(np.float64)


def _crop(
    rgb: NDArray[np.uint8], box: tuple[float, float, float, float], margin: float = 0.2
) -> NDArray[np.uint8]:
    """The picture in a box, and around it by a share of the longer side: what is near helps to recognise someone."""
    x0, y0, x1, y1 = box
    more = margin * max(x1 - x0, y1 - y0)
    rows = slice(max(0, int(y0 - more)), int(np.ceil(y1 + more)))
    return rgb[rows, max(0, int(x0 - more)) : int(np.ceil(x1 + more))].copy()
