"""Re-observation: rewards for viewpoints that would show unconfirmed or unread objects again."""

from collections.abc import Sequence
from math import radians

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.arrays import Place, Values
from pipeline.errors import required
from pipeline.frame import Frame
from pipeline.keyframes import AnchoredPlaces, Keyframes
from pipeline.metric_map.metric_map import MetricMap
from pipeline.tracks.config import ReobservationConfig
from pipeline.tracks.track import Track
from pipeline.tracks.tracks import Tracks
from pipeline.transforms import wrap_angle

MIN_NEW_ANGLE = radians(40)
"""Minimum angle between a viewpoint and earlier ones, as seen from the object, for the full reward, rad.

Within this angle of a viewpoint that showed nothing, there is no reward, because a person in a box is seen only from
the open side of the box.
"""
SPACING = 0.3
"""Distance between two viewpoints below which both show the same side of an object, m."""
MARGIN = 0.3
"""Distance from an object at which a line of sight to the object may end, m."""
BESIDE_CAMERA = 0.3
"""Length at the start of a line of sight that is assumed to be free, m, because the robot will stand there."""


class Reobservation:
    """Rewards viewpoints towards objects worth another look, and counts the tries to see each object again.

    Attributes:
        last_frame: the newest keyframe's frame, whose camera the next frame is assumed to share; None before the
            first keyframe.
    """

    def __init__(
        self,
        tracks: Sequence[Tracks],
        metric_map: MetricMap,
        keyframes: Keyframes,
        config: ReobservationConfig = ReobservationConfig(),
    ) -> None:
        """Reward viewpoints towards ``tracks`` worth another look, with lines of sight free in ``metric_map``."""
        self.last_frame: Frame | None = None
        self._tracks, self._map, self._keyframes, self._config = tracks, metric_map, keyframes, config
        self._aimed: list[tuple[Track, AnchoredPlaces]] = []

    @property
    def wanted(self) -> list[Track]:
        """The objects that are worth another look and were not tried too often."""
        wanted = (track for tracks in self._tracks for track in tracks.worth_a_look)
        return [track for track in wanted if len(track.tried) < self._config.max_tries]

    def gains(self, places: NDArray[np.float64], bearings: Values) -> NDArray[np.float64]:
        """(N, M) float64 rewards, m², of viewpoints at (N, 3) places on the ground with (M,) bearings, rad."""
        total = np.zeros((len(places), len(bearings)))
        for track in self.wanted:
            total += self._gains(track, places, bearings)
        return total

    def aim(self, place: Place, heading: float) -> None:
        """Store at which objects the next frame is aimed, given the robot's place (3,), m, and heading, rad."""
        bearing = np.array([heading])
        aimed = [track for track in self.wanted if self._gains(track, place[None], bearing).any()]
        poses = self._keyframes.poses
        anchored = AnchoredPlaces.anchored(place[None], poses, len(poses) - 1)
        self._aimed = [(track, anchored) for track in aimed]

    def count_try(self, frame: Frame) -> None:
        """Count a keyframe's frame as a try for each object at which it was aimed.

        A frame that was taken elsewhere, because the drive ended early, says nothing about the intended place.
        """
        self.last_frame = frame
        poses = self._keyframes.poses
        for track, place in self._aimed:
            is_there = _distances(place.at(poses), poses[-1:, :2, 3])[0] <= SPACING
            track.tried.append(place if is_there.all() else AnchoredPlaces.joined([]))
            track.tried_at += list(track.tried[-1].at(poses))
        self._aimed = []

    def _gains(self, track: Track, places: NDArray[np.float64], bearings: Values) -> NDArray[np.float64]:
        """(N, M) rewards, m², for one object."""
        frame = required(self.last_frame)
        sensor, height = frame.sensor, float(frame.T_base_camera[2, 3])
        target = np.median(track.points, axis=0).astype(np.float64)
        least, most = track.policy.viewing_range(track, sensor)
        way = target[:2] - places[:, :2]
        distance = np.linalg.norm(way, axis=1)
        reward = np.where((distance >= least) & (distance <= most), self._config.reward, 0.0)
        reward *= _newness(track, places, target)
        # At the object itself, the line of sight need not be free.
        body = cKDTree(track.points)
        some = np.flatnonzero(reward)
        cameras = places[some] + (0, 0, height)
        reward[some] *= self._map.are_sightlines_free(cameras, target, body, MARGIN, BESIDE_CAMERA)
        off = bearings - np.arctan2(way[:, 1], way[:, 0])[:, None]
        return reward[:, None] * (np.abs(wrap_angle(off)) <= max_view_angles(frame, track, distance)[:, None])


def max_view_angles(frame: Frame, track: Track, distance: Values) -> Values:
    """(N,) maximum angles from the image's middle, rad, at which an object at a distance, m, is wholly visible."""
    return np.asarray(frame.intrinsics.half_fov - np.arctan2(track.policy.across / 2, distance), np.float64)


def _newness(track: Track, places: NDArray[np.float64], target: Place) -> Values:
    """(N,) fraction of the reward: 0 near earlier viewpoints and on the side of viewpoints that showed nothing.

    A flat object shows nothing new from another side.
    """
    found, tried = (np.reshape(p, (-1, 3))[:, :2] for p in (track.camera_positions, track.tried_at))
    if track.policy.is_flat:
        return np.where(_distances(places, np.vstack([found, tried])).min(axis=1) > SPACING, 1.0, 0.0)
    useless = tried[_distances(tried, found).min(axis=1) > SPACING]
    share = np.clip(_angles(places, found, target).min(axis=1) / MIN_NEW_ANGLE, 0.0, 1.0)
    is_new = _distances(places, np.vstack([found, tried])).min(axis=1) > SPACING
    is_new &= _angles(places, useless, target).min(axis=1, initial=np.inf) >= MIN_NEW_ANGLE
    return np.where(is_new, share, 0.0)


def _distances(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, M) horizontal distances, m, between places (N, 2 or 3) and (M, 2)."""
    return np.linalg.norm(a[:, None, :2] - b, axis=2)


def _angles(a: NDArray[np.float64], b: NDArray[np.float64], target: Place) -> NDArray[np.float64]:
    """(N, M) horizontal angles, rad, between places (N, 2 or 3) and (M, 2) as seen from a target."""
    to_a, to_b = a[:, :2] - target[:2], b - target[:2]
    bearing_a, bearing_b = np.arctan2(to_a[:, 1], to_a[:, 0]), np.arctan2(to_b[:, 1], to_b[:, 0])
    return np.abs(wrap_angle(bearing_a[:, None] - bearing_b))
