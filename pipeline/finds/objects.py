"""How signs, codes, objects and heat are followed: all kinds of finds but people."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Points, Pose
from pipeline.frame import Frame
from pipeline.sensor import SensorModel
from pipeline.tracks.config import ObjectConfig, TracksConfig
from pipeline.tracks.find import FIND_KINDS
from pipeline.tracks.track import Location, Observation, Track, TrackPolicy, mahalanobis
from pipeline.transforms import inverse, transform_points

FLAT = ("hazmat_sign", "qr_code", "april_tag")
"""Kinds that show the same from wherever they are seen."""
CHECKED = ("qr_code", "april_tag")
"""Kinds that are read rightly or not at all, for they carry check sums."""


@dataclass(frozen=True, kw_only=True)
class ObjectPolicy(ObjectConfig, TrackPolicy):
    """A frame shows an object once; what is small in the image, or has no depth, is looked at from nearer."""

    def locate(self, placed: Sequence[Observation]) -> Location:
        """The mean by the information; the covariance is that of one, for observations from one place err alike."""
        counting = with_depth(placed)
        total = sum(seen.information for seen in counting)
        position = np.linalg.solve(total, sum(seen.information @ seen.position for seen in counting))
        best = max(counting, key=lambda seen: np.linalg.det(seen.information))
        covariance = np.asarray(np.linalg.inv(best.information), np.float64)
        return Location(np.asarray(position, np.float64), covariance, position[None].astype(np.float32))

    def shows(self, observation: Observation) -> float:
        """Pixels along a side, times the confidence."""
        return observation.reading.confidence * observation.reading.side

    def distance(self, track: Track, new: Track) -> float:
        """Infinite for codes of different texts."""
        is_other = self.has_checksum and bool(track.text and new.text) and track.text != new.text
        return np.inf if is_other else mahalanobis(track, new)

    def separation(self, one: Track, other: Track) -> float:
        """Within the gate; flat objects that one keyframe shows side by side are two."""
        if self.is_flat and one.keyframes & other.keyframes:
            return np.inf
        distance = self.distance(one, other)
        return distance if distance <= self.gate else np.inf

    def should_show(self, track: Track, frame: Frame, T_camera_map: Pose) -> bool:
        """The object is in the image at least as large as before, from about the same side, with nothing in front."""
        if not track.is_placed:
            return False
        here = inverse(T_camera_map)[:3, 3]
        position, cameras = track.position, np.array(track.cameras)
        ways = cameras - position
        if np.linalg.norm(here - position) > np.linalg.norm(ways, axis=1).max():
            return False
        bearing = (here - position) @ ways.T / np.linalg.norm(here - position) / np.linalg.norm(ways, axis=1)
        if bearing.max() < np.cos(self.same_side):
            return False
        point = transform_points(T_camera_map, position[None])
        pixels, inside = frame.intrinsics.project(point)
        if not inside.any() or point[0, 2] <= 0:
            return False
        row, column = pixels[inside][0]
        measured = float(frame.depth[row, column])
        return measured > 0 and abs(measured - point[0, 2]) < self.sigmas * np.sqrt(track.covariance.trace())

    def is_worth_a_look(self, track: Track) -> bool:
        """It has no place, or could not be read, or was always small.

        The robot goes nowhere to see a shape again: with nothing to find, that took a quarter more time than
        exploring alone.
        """
        largest = max(seen.reading.side for seen in track.seen)
        is_unread = not track.text if self.has_checksum else self.is_flat and largest < self.readable
        return (is_unread or not track.is_placed) and track.missed < len(track.seen)

    def distances(self, track: Track, sensor: SensorModel) -> tuple[float, float]:
        """From there it has depth and, if it was too small before, is large enough to be read."""
        nearest = min(track.placed, key=lambda seen: float(np.linalg.norm(seen.position - seen.camera)))
        way = float(np.linalg.norm(nearest.position - nearest.camera))
        share = max(nearest.reading.side / self.readable, self.nearer)
        readable = way * share if track.is_placed else sensor.farthest
        return sensor.nearest, min(sensor.farthest - sensor.margin, max(readable, sensor.nearest + sensor.margin))


def with_depth(placed: Sequence[Observation]) -> Sequence[Observation]:
    """The observations with depth, if any has it: those without guess how far away the object is."""
    return [seen for seen in placed if seen.has_depth] or placed


def shown(track: Track) -> Points:
    """Returns of an object in the best of the photos with depth."""
    return max(with_depth(track.placed), key=track.policy.shows).points


def policy_of(kind: str, config: TracksConfig) -> ObjectPolicy:
    """The policy of a kind of finds but people."""
    numbers: ObjectConfig = getattr(config, kind) if kind in FIND_KINDS else config.other
    return ObjectPolicy(
        kind=kind, is_flat=kind in FLAT, has_checksum=kind in CHECKED, likelihood=config.likelihood, **vars(numbers)
    )
