"""All tracks of some kinds: which observations are of one object, what is missed, confirmed and given up."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.arrays import Pose, Poses
from pipeline.frame import Frame
from pipeline.tracks.track import Track
from pipeline.transforms import inverse

LARGEST = 1e12
"""Bounds gates that accept every squared distance: those of other objects are infinite."""
Join = Callable[[list[Track], Sequence[Track]], list[Track]]
"""Adds new tracks to a list, each to the track of the same object or as one of its own; gives those that took one."""


class Tracks:
    """The objects of some kinds, confirmed or not.

    Attributes:
        all: in the order in which they were first seen, also those with little evidence.
    """

    def __init__(self, join: Join) -> None:
        """Begin with none; ``join`` decides which observations of a frame are of objects that it has."""
        self.all: list[Track] = []
        self._join = join

    @property
    def confirmed(self) -> list[Track]:
        """Those to report."""
        return [track for track in self.all if track.is_confirmed]

    @property
    def unconfirmed(self) -> list[Track]:
        """Those worth another look."""
        return [track for track in self.all if track.policy.is_worth_a_look(track)]

    def place(self, poses: Poses) -> None:
        """Move all with their keyframes, at these poses in ``map``, and merge what proves to be one object."""
        for track in self.all:
            track.place(poses)
        self._merge()

    def add(self, new: Sequence[Track], frame: Frame, T_map_camera: Pose) -> None:
        """Add what a keyframe shows, count what it should have shown as missed, and give up what is missed too often.

        Args:
            new: a track of each observation.
            frame: of the keyframe, with its depth.
            T_map_camera: pose of ``camera_optical``.
        """
        before, T_camera_map = list(self.all), inverse(T_map_camera)
        seen = self._join(self.all, new)
        for track in before:
            if track not in seen:
                track.missed += track.policy.should_show(track, frame, T_camera_map)
        self._merge()
        self.all = [track for track in self.all if not track.is_given_up]

    def _merge(self) -> None:
        """Make one of the tracks that have turned out to be of one object."""
        kept: list[Track] = []
        for track in self.all:
            apart = [_of_kind(track.policy.separation, other, track) for other in kept]
            if min(apart, default=np.inf) < np.inf:
                kept[int(np.argmin(apart))].take(track)
            else:
                kept.append(track)
        self.all = kept


def join_nearest(tracks: list[Track], new: Sequence[Track]) -> list[Track]:
    """Each observation to its nearest track: several of one frame may be parts of one object."""
    seen = []
    for one in new:
        distances = [_of_kind(one.policy.distance, track, one) for track in tracks]
        if min(distances, default=np.inf) < np.inf:
            nearest = tracks[int(np.argmin(distances))]
            nearest.take(one)
            seen.append(nearest)
        else:
            tracks.append(one)
    return seen


def join_one_to_one(tracks: list[Track], new: Sequence[Track]) -> list[Track]:
    """Each observation to another track, so that all are as near as possible: a frame shows an object once."""
    before = list(tracks)
    cost = np.array([[_of_kind(one.policy.distance, track, one) for track in before] for one in new])
    cost = cost.reshape(len(new), len(before))
    gates = np.minimum([one.policy.gate for one in new], LARGEST)
    rows, columns = linear_sum_assignment(np.minimum(cost, 2 * gates[:, None]))
    same = {row: before[column] for row, column in zip(rows, columns, strict=True) if cost[row, column] <= gates[row]}
    for row, one in enumerate(new):
        if row in same:
            same[row].take(one)
        else:
            tracks.append(one)
    return list(same.values())


def _of_kind(distance: Callable[[Track, Track], float], one: Track, other: Track) -> float:
    """The distance of two tracks; infinite if they are of two kinds."""
    return distance(one, other) if one.policy.kind == other.policy.kind else np.inf
