"""Policy for tracking people: where they are, which observations show one person, and which frames are misses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import cast

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Covariance, Indices, Information, Mask, Place, Points, Pose
from pipeline.frame import Frame
from pipeline.geometry.planes import distances
from pipeline.geometry.thinning import first_in_voxels
from pipeline.geometry.voxel_hash import first_points, voxels_of
from pipeline.sensor import SensorModel
from pipeline.tracks.config import Extents, PeopleConfig
from pipeline.tracks.find import VICTIM
from pipeline.tracks.likelihood import weigh
from pipeline.tracks.track import GATE, Location, Observation, Track, TrackPolicy, mahalanobis
from pipeline.transforms import transform_points

WIDTH_IN_IMAGE = 0.85
"""Width of a person that must be in the image when the person is looked at again, m."""
EXTENTS = (1.7, 0.5, 0.25), (1.1, 0.7, 0.5), (0.45, 0.2, 0.14)
"""Median extents of each form of people, the longest first, m.

- Standing or lying people: stature, shoulder breadth and chest depth (NASA-STD-3000, section 3.3).
- Sitting people: height, depth including the thighs, and shoulder breadth (from the same source). The height is 0.9 m
  on the ground and 1.3 m on a seat.
- Dolls, as in the RoboCup Rescue arena designer.
"""
TOUCH_DISTANCE = 0.15
"""Maximum distance between two sets of points that touch, m: three times the error of a keyframe's pose."""
WALL_GAP = 0.05
"""Distance behind a wall from which on points are certainly behind it, m: the error of a keyframe's pose."""
MIN_FRACTION_PER_SIDE = 0.8
"""Minimum fraction of a person's points that lie on the person's side of a wall between two people."""
MIN_VISIBLE_FRACTION = 0.7
"""Minimum fraction of a person's points that must be in view."""
VOXEL = 0.03
"""Edge length of a person's voxels, m."""
MIN_AGREEMENT = 0.2
"""Minimum fraction of the keyframes showing a person that must show a voxel for the voxel to belong to the person.

Keyframes in which the voxel is hidden count too: otherwise, a piece of a wall that one keyframe takes for a part of
the person would stay if the others do not have it in view, and the person would be too large to be confirmed.
"""
SKIN_TO_MIDDLE = 0.08
"""Standard deviation due to the distance from the visible skin to the middle of the body, m."""


@dataclass(frozen=True, eq=False)
class PersonVoxels:
    """The voxels that a person's observations show; voxels that only a few of them show may belong to other objects.

    Attributes:
        edge: edge length of a voxel, m.
        points: a point in each voxel.
        counts: number of observations that show each voxel.
    """

    edge: float
    points: Points
    counts: Indices

    @classmethod
    def of(cls, points: Points, edge: float) -> "PersonVoxels":
        """The voxels of one observation's points; ``edge`` in m."""
        first = first_in_voxels(points / edge)
        return cls(edge, points[first], np.ones(len(first), np.int64))

    @classmethod
    def joined(cls, observations: Sequence["PersonVoxels"]) -> "PersonVoxels":
        """The voxels of one or more observations together."""
        seen, edge = np.concatenate([voxels.points for voxels in observations]), observations[0].edge
        voxel, keys = voxels_of(seen / edge)
        shown = np.bincount(voxel, np.concatenate([voxels.counts for voxels in observations])).astype(np.int64)
        return cls(edge, seen[first_points(voxel, len(keys))], shown)

    def agreed_points(self, frames: float) -> Points:
        """A point in each voxel that at least ``frames`` observations show or, if there is none, in every voxel."""
        is_agreed = self.counts >= frames
        return self.points[is_agreed] if is_agreed.any() else self.points


@dataclass(frozen=True, kw_only=True)
class PeoplePolicy(PeopleConfig, TrackPolicy):
    """How people are tracked: several observations in a frame may show touching parts of one person."""

    kind: str = VICTIM
    across: float = WIDTH_IN_IMAGE
    extents: tuple[Extents, ...] = EXTENTS

    def locate(self, placed: Sequence[Observation]) -> "PersonBody":
        """The location of a person, from the voxels and the information of all observations."""
        voxels = PersonVoxels.joined([PersonVoxels.of(seen.points, VOXEL) for seen in placed])
        information = reduce(self.fused_information, [seen.information for seen in placed])
        return self.body(voxels, information, frozenset(seen.keyframe for seen in placed))

    def joined(self, one: Track, other: Track) -> "PersonBody":
        """The location of a person, from the voxels and the information of both tracks."""
        a, b = cast(PersonBody, one.location), cast(PersonBody, other.location)
        voxels = PersonVoxels.joined([a.voxels, b.voxels])
        # The order is that of `locate`, because the result depends on it.
        information = reduce(self.fused_information, [seen.information for seen in other.placed], a.information)
        return self.body(voxels, information, a.keyframes | b.keyframes)

    def body(self, voxels: PersonVoxels, information: Information, keyframes: frozenset[int]) -> "PersonBody":
        """A person located by voxels, without the voxels that only a few of the keyframes show."""
        points = voxels.agreed_points(MIN_AGREEMENT * len(keyframes))
        return PersonBody(middle(points), _inverse(information), points, voxels, information, keyframes)

    def fused_information(self, one: Information, other: Information) -> Information:
        """The sum of two information matrices, limited because errors from one viewpoint are correlated."""
        return _inverse(_inverse(one + other) + np.eye(3) * (SKIN_TO_MIDDLE / 2) ** 2)

    def photo_score(self, observation: Observation) -> float:
        """Number of voxels that the observation shows, times its confidence."""
        return len(observation.points) * observation.reading.confidence

    def distance(self, track: Track, new: Track) -> float:
        """Squared Mahalanobis distance; infinite if the tracks are too far apart or show two people."""
        distance = mahalanobis(track, new)
        if self._are_two_people(track, new) or not (distance <= GATE or self._are_touching(track, new)):
            return np.inf
        return distance

    def merge_distance(self, one: Track, other: Track) -> float:
        """0 if both tracks touch and do not show two people; otherwise infinite."""
        return 0.0 if not self._are_two_people(one, other) and self._are_touching(one, other) else np.inf

    def _are_two_people(self, one: Track, other: Track) -> bool:
        """Whether two tracks show two people, however near to each other."""
        return self._are_seen_apart(one, other) or _is_wall_between(one, other) or _is_wall_between(other, one)

    def _are_touching(self, one: Track, other: Track) -> bool:
        """Whether two tracks touch, or parts of them that a keyframe shows, but too few others for the tracks."""
        return _touch(one.points, other.points) or any(_touch(a, b) for a, b in _parts_in_same_keyframes(one, other))

    def _are_seen_apart(self, one: Track, other: Track) -> bool:
        """Whether a keyframe shows both tracks apart."""
        return any(not _touch(a, b) for a, b in _parts_in_same_keyframes(one, other))

    def is_expected_in_view(self, track: Track, frame: Frame, T_camera_map: Pose) -> bool:
        """Whether the person is near enough, and most points are in the image with nothing in front of them."""
        depth = transform_points(T_camera_map, track.points)[:, 2]
        _, farthest = self.viewing_range(track, frame.sensor)
        if np.median(depth) > farthest:
            return False
        return bool(_are_in_view(track.points, frame, T_camera_map).mean() > MIN_VISIBLE_FRACTION)

    def is_worth_a_look(self, track: Track) -> bool:
        """Whether there is evidence of the person, but not enough to confirm the person."""
        return track.evidence >= self.evidence_to_look and not track.is_confirmed

    def viewing_range(self, track: Track, sensor: SensorModel) -> tuple[float, float]:
        """Minimum and maximum distance at which the whole person is in the image and in the camera's range, m."""
        return sensor.nearest + self.across / 2, sensor.farthest - self.across / 2

    def has_shape(self, track: Track) -> bool:
        """Whether all points seen, taken together, are more like a person than like background."""
        return weigh(self.extents, track.points, track.ground).log_ratio > 0


@dataclass(frozen=True, eq=False)
class PersonBody(Location):
    """The location of a person, with data for locating the person again when observations are added.

    Attributes:
        voxels: the voxels that the observations show.
        information: inverse of the position's covariance.
        keyframes: indices of the keyframes that show the person.
    """

    voxels: PersonVoxels
    information: Information
    keyframes: frozenset[int]


def middle(points: Points) -> Place:
    """Middle of the bounding box of points, without the outermost 2% at either end of each axis."""
    return np.percentile(points, [2, 98], axis=0).mean(axis=0)


def _are_in_view(points: Points, frame: Frame, T_camera_map: Pose) -> Mask:
    """(N,) whether each point is in a frame's image, with no return nearer by ``TOUCH_DISTANCE`` or more in front."""
    in_camera = transform_points(T_camera_map, points)
    pixels, result = frame.intrinsics.project(in_camera)
    row, column = pixels[result].T
    result[result] = frame.returns[row, column] & (frame.depth[row, column] > in_camera[result, 2] - TOUCH_DISTANCE)
    return result


def _is_wall_between(one: Track, other: Track) -> bool:
    """Whether ``one`` is seen in front of a wall and ``other`` is behind this wall, except for a few points each."""
    walls = np.concatenate([seen.walls for seen in one.placed])
    is_in_front = (distances(one.points, walls) > 0).mean(axis=0) >= MIN_FRACTION_PER_SIDE
    is_behind = (distances(other.points, walls) < -WALL_GAP).mean(axis=0) >= MIN_FRACTION_PER_SIDE
    return bool((is_in_front & is_behind).any())


def _touch(one: Points, other: Points) -> bool:
    """Whether the nearest points of two sets are at most ``TOUCH_DISTANCE`` apart."""
    small, large = sorted((one, other), key=len)
    return bool(cKDTree(small).query(large, distance_upper_bound=TOUCH_DISTANCE)[0].min() <= TOUCH_DISTANCE)


def _parts_in_same_keyframes(one: Track, other: Track) -> Iterator[tuple[Points, Points]]:
    """The points of two tracks as each keyframe that shows both tracks shows them, in its ``base_link``."""
    for keyframe in sorted(one.keyframes & other.keyframes):
        a, b = (
            np.concatenate([seen.points for seen in track.seen if seen.keyframe == keyframe])
            for track in (one, other)
        )
        yield a, b


def _inverse(matrix: Covariance | Information) -> Covariance | Information:
    return np.linalg.inv(matrix).astype(np.float64)
