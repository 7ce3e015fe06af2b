"""Re-observation: rewards for viewpoints from which unconfirmed victims would be seen again."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.keyframes import Keyframes, Places
from pipeline.localisation.localisation import KEYFRAME_WAY
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import wrap_angle
from pipeline.victims.observation import PERSON_GAP
from pipeline.victims.victim_map import WHOLE, Victim, Victims, farthest_whole

REWARD = 1.0  # m² of unseen ground to which a viewpoint towards an unconfirmed victim is equivalent
NEW_SIDE = np.deg2rad(40)
"""rad, least angle between a viewpoint and earlier ones, seen from the victim, for the full reward; and for any
reward from viewpoints that showed nothing: a person in a box is seen only from its open side."""
MAX_TRIES = 4  # Most re-observations of each victim
BESIDE_CAMERA = 0.3  # m of a line of sight that count as free because the robot itself will stand there


class Reobservation:
    """Rewards of viewpoints towards unconfirmed victims, and the tries to re-observe each victim.

    Attributes:
        camera: the last frame, of whose kind the next will be; None before the first.
    """

    def __init__(self, victims: Victims, metric_map: MetricMap, keyframes: Keyframes) -> None:
        """Reward viewpoints towards these victims along lines of sight that are free in this map."""
        self.camera: Frame | None = None
        self._victims, self._map, self._keyframes = victims, metric_map, keyframes
        self._aimed: list[tuple[Victim, Places]] = []

    @property
    def wanted(self) -> list[Victim]:
        """The victims to be observed again: not confirmed, and tried less than MAX_TRIES times."""
        return [victim for victim in self._victims.unconfirmed if len(victim.tried) < MAX_TRIES]

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) float64 rewards, m², of viewpoints at (N, 3) places on the ground along (M,) bearings, rad."""
        total = np.zeros((len(places), len(bearings)))
        for victim in self.wanted:
            total += self._gains(victim, places, bearings)
        return total

    def aim(self, place: NDArray[np.float64], heading: float) -> None:
        """Note that the next frame is to be taken from a place (3,) on the ground along a heading, rad."""
        bearing = np.array([heading])
        aimed = [v for v in self.wanted if self._gains(v, place[None], bearing).any()]
        poses = self._keyframes.poses
        anchored = Places.anchored(place[None], poses, len(poses) - 1)
        self._aimed = [(victim, anchored) for victim in aimed]

    def count(self, frame: Frame) -> None:
        """Count this frame as a try for each victim at which it was aimed."""
        self.camera = frame
        for victim, place in self._aimed:
            victim.tried.append(place)
            victim.tried_at += list(place.at(self._keyframes.poses))
        self._aimed = []

    def _gains(
        self, victim: Victim, places: NDArray[np.float64], bearings: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, M) rewards, m², for one victim."""
        assert self.camera is not None
        sensor, height = self.camera.sensor, float(self.camera.T_base_camera[2, 3])
        target = np.median(victim.points, axis=0).astype(np.float64)
        way = target[:2] - places[:, :2]
        distance = np.linalg.norm(way, axis=1)
        reward = np.where(
            (distance >= sensor.nearest + WHOLE / 2) & (distance <= farthest_whole(sensor)), REWARD, 0.0
        )
        reward *= _newness(victim, places, target)
        # Where the victim itself is, the line of sight need not be free.
        body = cKDTree(victim.points)
        for n in np.flatnonzero(reward):
            camera = places[n] + (0, 0, height)
            reward[n] *= self._map.is_free_along(camera, target, body, PERSON_GAP, BESIDE_CAMERA)
        off = bearings - np.arctan2(way[:, 1], way[:, 0])[:, None]
        return reward[:, None] * (np.abs(wrap_angle(off)) <= half_view(self.camera))


def half_view(frame: Frame) -> float:
    """rad from the middle of the image within which a person, at the end of the camera's range, is whole."""
    lens = frame.intrinsics
    half = min(np.arctan2(lens.cx, lens.fx), np.arctan2(lens.width - lens.cx, lens.fx))
    return float(half - np.arctan2(WHOLE / 2, farthest_whole(frame.sensor)))


def _newness(victim: Victim, places: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) share of the reward: 0 beside earlier viewpoints, and on the side of viewpoints that showed nothing."""
    found, tried = (np.reshape(p, (-1, 3))[:, :2] for p in (victim.cameras, victim.tried_at))
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
