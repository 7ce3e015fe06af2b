"""Re-observation: rewards for viewpoints that would show again what is not confirmed, or could not be read."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.keyframes import Keyframes, Places
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.metric_map.metric_map import MetricMap
from pipeline.tracks.sought import THING_GAP, Seeker, Sought
from pipeline.transforms import wrap_angle

REWARD = 1.0  # m² of unseen ground to which a viewpoint towards such a thing is equivalent
NEW_SIDE = np.deg2rad(40)
"""rad, least angle between a viewpoint and earlier ones, seen from the thing, for the full reward; and for any
reward from viewpoints that showed nothing: a person in a box is seen only from its open side."""
MAX_TRIES = 4  # Most re-observations of each thing
BESIDE_CAMERA = 0.3  # m of a line of sight that count as free because the robot itself will stand there


class Reobservation:
    """Rewards of viewpoints towards what is sought, and the tries to see each thing again.

    Attributes:
        camera: the last frame, of whose kind the next will be; None before the first.
    """

    def __init__(self, seekers: Sequence[Seeker], metric_map: MetricMap, keyframes: Keyframes) -> None:
        """Reward viewpoints towards what these seek along lines of sight that are free in this map."""
        self.camera: Frame | None = None
        self._seekers, self._map, self._keyframes = seekers, metric_map, keyframes
        self._aimed: list[tuple[Sought, Places]] = []

    @property
    def wanted(self) -> list[Sought]:
        """The things to be seen again: not confirmed, and tried less than MAX_TRIES times."""
        unconfirmed = (thing for seeker in self._seekers for thing in seeker.unconfirmed)
        return [thing for thing in unconfirmed if len(thing.tried) < MAX_TRIES]

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) float64 rewards, m², of viewpoints at (N, 3) places on the ground along (M,) bearings, rad."""
        total = np.zeros((len(places), len(bearings)))
        for thing in self.wanted:
            total += self._gains(thing, places, bearings)
        return total

    def aim(self, place: NDArray[np.float64], heading: float) -> None:
        """Note that the next frame is to be taken from a place (3,) on the ground along a heading, rad."""
        bearing = np.array([heading])
        aimed = [thing for thing in self.wanted if self._gains(thing, place[None], bearing).any()]
        poses = self._keyframes.poses
        anchored = Places.anchored(place[None], poses, len(poses) - 1)
        self._aimed = [(thing, anchored) for thing in aimed]

    def count(self, frame: Frame) -> None:
        """Count this frame as a try for each thing at which it was aimed."""
        self.camera = frame
        for thing, place in self._aimed:
            thing.tried.append(place)
            thing.tried_at += list(place.at(self._keyframes.poses))
        self._aimed = []

    def _gains(
        self, thing: Sought, places: NDArray[np.float64], bearings: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, M) rewards, m², for one thing."""
        assert self.camera is not None
        sensor, height = self.camera.sensor, float(self.camera.T_base_camera[2, 3])
        target = np.median(thing.points, axis=0).astype(np.float64)
        least, most = thing.distances(sensor)
        way = target[:2] - places[:, :2]
        distance = np.linalg.norm(way, axis=1)
        reward = np.where((distance >= least) & (distance <= most), REWARD, 0.0)
        reward *= _newness(thing, places, target)
        # Where the thing itself is, the line of sight need not be free.
        body = cKDTree(thing.points)
        for n in np.flatnonzero(reward):
            camera = places[n] + (0, 0, height)
            reward[n] *= self._map.is_free_along(camera, target, body, THING_GAP, BESIDE_CAMERA)
        off = bearings - np.arctan2(way[:, 1], way[:, 0])[:, None]
        return reward[:, None] * (np.abs(wrap_angle(off)) <= half_view(self.camera, thing))


def half_view(frame: Frame, thing: Sought) -> float:
    """rad from the middle of the image within which a thing, as far away as it would be looked at, is whole."""
    _, most = thing.distances(frame.sensor)
    return float(frame.intrinsics.half_view - np.arctan2(thing.across / 2, most))


def _newness(thing: Sought, places: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) share of the reward: 0 beside earlier viewpoints, and on the side of viewpoints that showed nothing.

    Of a flat thing another side shows no more.
    """
    found, tried = (np.reshape(p, (-1, 3))[:, :2] for p in (thing.cameras, thing.tried_at))
    if thing.is_flat:
        return np.where(_distances(places, np.vstack([found, tried])).min(axis=1) > KEYFRAME_WAY, 1.0, 0.0)
    in_vain = tried[_distances(tried, found).min(axis=1) > KEYFRAME_WAY]
    share = np.clip(_angles(places, found, target).min(axis=1) / NEW_SIDE, 0.0, 1.0)
    is_new = _distances(places, np.vstack([found, tried])).min(axis=1) > KEYFRAME_WAY
    is_new &= _angles(places, in_vain, target).min(axis=1, initial=np.inf) >= NEW_SIDE
    return np.where(is_new, share, 0.0)


def _distances(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, M) horizontal distances, m, between places (N, 2 or 3) and (M, 2)."""
    return np.linalg.norm(a[:, None, :2] - b, axis=2)


def _angles(a: NDArray[np.float64], b: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, M) horizontal angles, rad, between places (N, 2 or 3) and (M, 2) as seen from a target (3,)."""
    to_a, to_b = a[:, :2] - target[:2], b - target[:2]
    bearing_a, bearing_b = np.arctan2(to_a[:, 1], to_a[:, 0]), np.arctan2(to_b[:, 1], to_b[:, 0])
    return np.abs(wrap_angle(bearing_a[:, None] - bearing_b))
