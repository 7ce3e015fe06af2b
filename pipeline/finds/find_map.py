"""Finds on the map: the sightings of each, anchored to their keyframes, and whether they suffice to report it."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.finds.reobservation import NEW_SIDE
from pipeline.finds.warm_victims import one_per_victim
from pipeline.frame import Frame
from pipeline.keyframes import Places
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.sensor import SensorModel
from pipeline.tracks.find import CODES, HEAT, PRINTED, SHAPED, Find, Reading
from pipeline.tracks.observation import FindSighting, sight
from pipeline.tracks.sought import THING_GAP, apart
from pipeline.transforms import inverse, transform_points
from pipeline.victims.victim_map import Victims

READABLE = 60
"""Pixels along a side from which signs and codes are surely read: two for a module of a small QR code."""


@dataclass(eq=False)
class TrackedFind:
    """A thing on the map, reported or not.

    Attributes:
        kind: one of ``FIND_KINDS``.
        seen: its sightings, in ``base_link`` of their keyframes.
        sightings: the same in ``map``.
        missed: number of keyframes that should have shown it and did not.
        tried: the places on the ground from which it was to be seen again, one each.
        tried_at: (3,) float64 each, these places, m in ``map``.
    """

    kind: str
    seen: list[FindSighting]
    sightings: list[FindSighting]
    missed: int = 0
    tried: list[Places] = field(default_factory=list)
    tried_at: list[NDArray[np.float64]] = field(default_factory=list)

    def place(self, poses: NDArray[np.float64]) -> None:
        """Move it along with its keyframes, at (K, 4, 4) poses in ``map``."""
        self.sightings = [sighting.moved(poses[sighting.keyframe]) for sighting in self.seen]
        self.tried_at = list(Places.joined(self.tried).at(poses))

    def take(self, other: "TrackedFind") -> None:
        """Add the sightings of what has turned out to be the same thing."""
        self.seen += other.seen
        self.sightings += other.sightings
        self.missed = min(self.missed, other.missed)
        self.tried += other.tried
        self.tried_at += other.tried_at
        self._keep_best_photo()

    def _keep_best_photo(self) -> None:
        best = self._best
        for seen in (self.seen, self.sightings):
            seen[:] = [s if k == best else replace(s, photo=s.photo[:0]) for k, s in enumerate(seen)]

    @property
    def _best(self) -> int:
        return int(np.argmax([_shows(s) for s in self.sightings]))

    @property
    def is_placed(self) -> bool:
        """Whether any sighting had depth."""
        return any(sighting.has_depth for sighting in self.sightings)

    @property
    def _placing(self) -> list[FindSighting]:
        """The sightings with depth, if any has it: those without guess how far away it is."""
        return [s for s in self.sightings if s.has_depth] or self.sightings

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3) float64 of the position, m²: sightings from one place err alike, so none is counted on."""
        best = max(self._placing, key=lambda s: np.linalg.det(s.information))
        return np.asarray(np.linalg.inv(best.information), np.float64)

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) float64 mean of the sightings by their information, m in ``map``."""
        total = sum(s.information for s in self._placing)
        weighted = sum(s.information @ s.position for s in self._placing)
        return np.asarray(np.linalg.solve(total, weighted), np.float64)

    @property
    def text(self) -> str:
        """What most sightings say, weighted by their confidences; empty if none could be read."""
        votes = defaultdict[str, float](float)
        for sighting in self.sightings:
            votes[sighting.reading.text] += sighting.reading.confidence if sighting.reading.text else 0.0
        return max(votes, key=lambda text: (votes[text], text))

    @property
    def evidence(self) -> float:
        """Sum of the confidences of all sightings."""
        return sum(sighting.reading.confidence for sighting in self.sightings)

    @property
    def confidence(self) -> float:
        """That of a code which was decoded is 1; else the mean over sightings and misses, which count as 0."""
        if self.kind in CODES and self.text:
            return 1.0
        return self.evidence / (len(self.sightings) + self.missed)

    @property
    def is_refuted(self) -> bool:
        """Whether it is no code that was decoded, and was missed more than twice as often as seen."""
        return self.missed > 2 * len(self.sightings) and not (self.kind in CODES and self.text)

    @property
    def is_confirmed(self) -> bool:
        """Whether it is placed, read if a code, seen from two places if told by its shape, and likelier than not."""
        can_be_read = self.kind not in CODES or bool(self.text)
        return self.is_placed and can_be_read and self._is_borne_out and self.confidence > 1 / 2

    @property
    def is_wanted(self) -> bool:
        """Whether a nearer look would tell more: it has no place, or could not be read, or was always small."""
        largest = max(sighting.reading.side for sighting in self.sightings)
        is_unread = not self.text if self.kind in CODES else self.is_flat and largest < READABLE
        return (is_unread or not self.is_placed) and self.missed < len(self.sightings)

    @property
    def _is_borne_out(self) -> bool:
        """False if it is told by its shape and was seen from one place: the edge of a thing may look like another.

        The robot goes nowhere for it: with nothing to find, that took a quarter more time than exploring alone.
        """
        return self.kind not in SHAPED or apart(self.cameras) >= KEYFRAME_WAY

    @property
    def across(self) -> float:
        """m that are to be in the image: the largest signs."""
        return THING_GAP

    @property
    def is_flat(self) -> bool:
        """What is printed looks the same from another side."""
        return self.kind in PRINTED

    @property
    def points(self) -> NDArray[np.float32]:
        """(1, 3) float32 its position, m in ``map``."""
        return self.position[None].astype(np.float32)

    @property
    def points_shown(self) -> NDArray[np.float32]:
        """(N, 3) float32 its returns in the best of the photos with depth, m in ``map``."""
        return max(self._placing, key=_shows).points

    @property
    def cameras(self) -> list[NDArray[np.float64]]:
        """(3,) float64 each, positions of the camera in the frames that show it, m in ``map``."""
        return [sighting.camera for sighting in self.sightings]

    def distances(self, sensor: SensorModel) -> tuple[float, float]:
        """Distances, m, from which it has depth and, if it was too small before, is large enough to be read."""
        nearest = min(self.sightings, key=lambda s: float(np.linalg.norm(s.position - s.camera)))
        way = float(np.linalg.norm(nearest.position - nearest.camera))
        readable = way * max(nearest.reading.side / READABLE, 1 / 2) if self.is_placed else sensor.farthest
        return sensor.nearest, min(sensor.farthest - sensor.margin, max(readable, sensor.nearest + sensor.margin))

    def find(self) -> Find:
        """What is reported of it."""
        best = self.sightings[self._best]
        first = min(sighting.time for sighting in self.sightings)
        return Find(
            self.kind, self.text, self.position, self.covariance, first, min(1.0, self.confidence), best.photo
        )


class Finds:
    """All things on the map but people, reported or not.

    Attributes:
        all: in the order in which they were seen first.
        readings: in the last frame.
    """

    def __init__(self, victims: Victims) -> None:
        """``victims``: the people on the map, who give off heat."""
        self.all: list[TrackedFind] = []
        self.readings: list[Reading] = []
        self._victims = victims

    @property
    def confirmed(self) -> list[Find]:
        """What is reported; what is warm of a person as one find, and no shape that a person has."""
        found = [thing.find() for thing in self.all if thing.is_confirmed]
        if not any(find.kind in (HEAT, *SHAPED) for find in found):
            return found  # whether victims are confirmed takes long, and this is asked at every step
        victims = self._victims.confirmed
        return list(one_per_victim(found, victims, [v for v in self._victims.suspected if v not in victims]))

    @property
    def shown(self) -> list[NDArray[np.float32]]:
        """(N, 3) float32 points of every flat thing that is reported, m in ``map``.

        What hangs flat on a wall looks like the wall; other things stand out of it.
        """
        return [thing.points_shown for thing in self.all if thing.is_flat and thing.is_confirmed]

    @property
    def unconfirmed(self) -> list[TrackedFind]:
        """What is worth another look from nearer."""
        return [thing for thing in self.all if thing.is_wanted]

    def place(self, poses: NDArray[np.float64]) -> None:
        """Move all along with the keyframes, at (K, 4, 4) poses in ``map``, and join what proves to be one thing."""
        for thing in self.all:
            thing.place(poses)
        self._merge()

    def update(
        self, frame: Frame, readings: Sequence[Reading], T_map_base: NDArray[np.float64], keyframe: int
    ) -> None:
        """Add what was read in a keyframe, each to the thing that it shows or as a new one, and count misses.

        Args:
            frame: with its depth.
            readings: in its image.
            T_map_base: 4×4 pose of the robot.
            keyframe: number of the keyframe.
        """
        self.readings = list(readings)
        seen = [sight(frame, reading, keyframe, T_map_base) for reading in readings]
        T_base_map = inverse(T_map_base)
        new = [TrackedFind(s.reading.kind, [s.moved(T_base_map)], [s]) for s in seen]
        before = list(self.all)
        cost = np.array([[_distance(one, other) for other in before] for one in new]).reshape(len(new), len(before))
        rows, columns = linear_sum_assignment(np.minimum(cost, 2 * chi2_gate(3)))
        same = {row: column for row, column in zip(rows, columns, strict=True) if cost[row, column] <= chi2_gate(3)}
        for row, thing in enumerate(new):
            if row in same:
                before[same[row]].take(thing)
            else:
                self.all.append(thing)
        T_camera_map = inverse(T_map_base @ frame.T_base_camera)
        for column, thing in enumerate(before):
            thing.missed += column not in same.values() and _should_show(thing, frame, T_camera_map)
        self._merge()
        self.all = [thing for thing in self.all if not thing.is_refuted]

    def _merge(self) -> None:
        """Join things that have turned out to be one; flat ones that one keyframe shows side by side are two."""
        kept: list[TrackedFind] = []
        for thing in self.all:
            shown = {s.keyframe for s in thing.seen if thing.is_flat}
            apart = [_distance(thing, o) if shown.isdisjoint(s.keyframe for s in o.seen) else np.inf for o in kept]
            if min(apart, default=np.inf) <= chi2_gate(3):
                kept[int(np.argmin(apart))].take(thing)
            else:
                kept.append(thing)
        self.all = kept


def _shows(seen: FindSighting) -> float:
    """How much a sighting's photo shows: pixels along a side, times the confidence."""
    return seen.reading.confidence * seen.reading.side


def _distance(one: TrackedFind, other: TrackedFind) -> float:
    """Squared Mahalanobis distance of two things; infinite if they are of two kinds, or codes that say two things."""
    says_other = one.kind in CODES and bool(one.text and other.text) and one.text != other.text
    if one.kind != other.kind or says_other:
        return np.inf
    apart = one.position - other.position
    return float(apart @ np.linalg.solve(one.covariance + other.covariance, apart))


def _should_show(thing: TrackedFind, frame: Frame, T_camera_map: NDArray[np.float64]) -> bool:
    """Whether a frame shows the place of a thing at least as large as it was seen before, with nothing in front."""
    if not thing.is_placed:
        return False
    here = inverse(T_camera_map)[:3, 3]
    position, cameras = thing.position, np.array(thing.cameras)
    ways = cameras - position
    if np.linalg.norm(here - position) > np.linalg.norm(ways, axis=1).max():
        return False
    # From the side a sign is narrower, or not to be seen at all.
    bearing = (here - position) @ ways.T / np.linalg.norm(here - position) / np.linalg.norm(ways, axis=1)
    if bearing.max() < np.cos(NEW_SIDE):
        return False
    point = transform_points(T_camera_map, position[None])
    pixels, inside = frame.intrinsics.project(point)
    if not inside.any() or point[0, 2] <= 0:
        return False
    row, column = pixels[inside][0]
    measured = float(frame.depth[row, column])
    return measured > 0 and abs(measured - point[0, 2]) < 3 * np.sqrt(thing.covariance.trace())
