"""All tracks of some kinds, and the choice of the observations that are of one object."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.arrays import Pose, Poses
from pipeline.frame import Frame
from pipeline.tracks.track import GATE, Track
from pipeline.transforms import inverse

Join = Callable[[list[Track], Sequence[Track]], list[Track]]
"""Function that adds each new track to a track of the same object or to the list; it returns tracks that grew."""


class Tracks:
    """The objects of some kinds, confirmed or not.

    Attributes:
        all: all tracks, in the order in which they were first seen, including tracks with little evidence.
    """

    def __init__(self, join: Join) -> None:
        """Start without tracks; ``join`` decides which observations of a frame are of known objects."""
        self.all: list[Track] = []
        self._join = join

    @property
    def confirmed(self) -> list[Track]:
        """The tracks to report."""
        return [track for track in self.all if track.is_confirmed]

    @property
    def worth_a_look(self) -> list[Track]:
        """The tracks worth another look."""
        return [track for track in self.all if track.policy.is_worth_a_look(track)]

    def apply_poses(self, poses: Poses) -> None:
        """Move all tracks with their keyframes to these ``poses`` in ``map``, and merge tracks of one object."""
        for track in self.all:
            track.apply_poses(poses)
        self._merge()

    def add(self, new: Sequence[Track], frame: Frame, T_map_camera: Pose, keyframe: int) -> None:
        """Add a keyframe's observations, count misses of tracks, and drop tracks that were missed too often.

        Args:
            new: one track per observation.
            frame: the keyframe's frame, with its depth.
            T_map_camera: pose of ``camera_optical``.
            keyframe: index of the keyframe.
        """
        before, T_camera_map = list(self.all), inverse(T_map_camera)
        seen = self._join(self.all, new)
        for track in before:
            if track not in seen and track.policy.is_expected_in_view(track, frame, T_camera_map):
                track.missed.add(keyframe)
        self._merge()
        self.all = [track for track in self.all if not track.is_given_up]

    def _merge(self) -> None:
        """Merge tracks that have turned out to be of one object."""
        kept: list[Track] = []
        for track in self.all:
            apart = [_distance_within_kind(track.policy.merge_distance, other, track) for other in kept]
            if min(apart, default=np.inf) < np.inf:
                kept[int(np.argmin(apart))].absorb(track)
            else:
                kept.append(track)
        self.all = kept


def join_nearest(tracks: list[Track], new: Sequence[Track]) -> list[Track]:
    """Add each observation to its nearest track, because a frame's observations may be parts of one object."""
    seen = []
    for one in new:
        distances = [_distance_within_kind(one.policy.distance, track, one) for track in tracks]
        if min(distances, default=np.inf) < np.inf:
            nearest = tracks[int(np.argmin(distances))]
            nearest.absorb(one)
            seen.append(nearest)
        else:
            tracks.append(one)
    return seen


def join_one_to_one(tracks: list[Track], new: Sequence[Track]) -> list[Track]:
    """Add observations to tracks one to one with minimum total distance, because a frame shows each object once."""
    before = list(tracks)
    cost = np.array([[_distance_within_kind(one.policy.distance, track, one) for track in before] for one in new])
    cost = cost.reshape(len(new), len(before))
    rows, columns = linear_sum_assignment(np.minimum(cost, 2 * GATE))
    same = {row: before[column] for row, column in zip(rows, columns, strict=True) if cost[row, column] <= GATE}
    for row, one in enumerate(new):
        if row in same:
            same[row].absorb(one)
        else:
            tracks.append(one)
    return list(same.values())


def _distance_within_kind(distance: Callable[[Track, Track], float], one: Track, other: Track) -> float:
    """The distance between two tracks; infinite if they are of different kinds."""
    return distance(one, other) if one.policy.kind == other.policy.kind else np.inf
