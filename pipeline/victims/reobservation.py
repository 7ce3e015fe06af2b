"""Second looks: from where someone who is not confirmed ought to be looked at again, and what that is worth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.metric_map.metric_map import FREE, MetricMap
from pipeline.transforms import wrap_angles
from pipeline.victims.victim_map import Victim, Victims

_STEP, _HERE = 0.08, 0.3
"""m between the places of a line of sight that must be free; from the camera where the robot itself will stand."""


@dataclass(frozen=True)
class ReobservationConfig:
    """What a second look is worth, and from where.

    Attributes:
        worth: m² of unseen ground that a look at someone unconfirmed counts for.
        angle: between looks, seen from the victim, from which on it counts in full, rad.
        vain: angle at least from looks in vain, rad: who lies in a box is seen from its open side alone.
        least: share of the worth that counts however small the angle is.
        near, far: distances from the victim, m.
        half_view: from the middle of the view within which the victim must be, rad.
        camera_height: above the ground, m.
        margin: m around what was seen of the victim; within that nothing hides it, but the victim itself.
        tries: second looks at most at each.
    """

    worth: float = 1.0
    angle: float = np.deg2rad(30)
    vain: float = np.deg2rad(50)
    least: float = 0.3
    near: float = 1.3
    far: float = 3.2
    half_view: float = np.deg2rad(18)
    camera_height: float = 0.6
    margin: float = 0.35
    tries: int = 4


class Reobservation:
    """Weighs views by whom they would confirm, and counts how often each was looked at again."""

    def __init__(self, victims: Victims, metric_map: MetricMap, config: ReobservationConfig | None = None):
        """Of these victims, along lines of sight that are free in this map."""
        self.config = config or ReobservationConfig()
        self._victims, self._map = victims, metric_map
        self._aimed: list[tuple[Victim, NDArray[np.float64]]] = []

    @property
    def wanted(self) -> list[Victim]:
        """Those to be looked at again: not confirmed, and not given up."""
        return [victim for victim in self._victims.unconfirmed if len(victim.tried) < self.config.tries]

    def gains(self, places: NDArray[np.float64], bearings: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, M) m² that looks from (N, 3) places on the ground along (M,) bearings (rad) count for."""
        total = np.zeros((len(places), len(bearings)))
        for victim in self.wanted:
            total += self._gains(victim, places, bearings)
        return total

    def aim(self, place: NDArray[np.float64], heading: float) -> None:
        """Tell that the next look is to be from a place (3,) on the ground along a heading."""
        bearing = np.array([heading])
        aimed = [v for v in self.wanted if self._gains(v, place[None], bearing).any()]
        self._aimed = [(victim, place) for victim in aimed]

    def count(self) -> None:
        """Tell that this look has been taken."""
        for victim, place in self._aimed:
            victim.tried.append(place)
        self._aimed = []

    def _gains(
        self, victim: Victim, places: NDArray[np.float64], bearings: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, M) m² for one of them."""
        config, target = self.config, np.median(victim.points, axis=0).astype(np.float64)
        way = target[:2] - places[:, :2]
        distance = np.linalg.norm(way, axis=1)
        worth = np.where((distance >= config.near) & (distance <= config.far), config.worth, 0.0)
        worth *= self._newness(victim, places, target)
        body = cKDTree(victim.points)
        for n in np.flatnonzero(worth):
            worth[n] *= self._is_open(places[n] + (0, 0, config.camera_height), target, body)
        off = bearings - np.arctan2(way[:, 1], way[:, 0])[:, None]
        in_view = np.abs(wrap_angles(off)) <= config.half_view
        return worth[:, None] * in_view

    def _newness(
        self, victim: Victim, places: NDArray[np.float64], target: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N,) share of the worth: none where it was looked at from, nor on the side of looks in vain."""
        config, apart = self.config, self._victims.config.apart
        found, tried = (np.reshape(p, (-1, 3))[:, :2] for p in (victim.cameras, victim.tried))
        vain = tried[_distances(tried, found).min(axis=1) >= apart]
        share = np.clip(_angles(places, found, target).min(axis=1) / config.angle, config.least, 1.0)
        is_new = _distances(places, np.vstack([found, tried])).min(axis=1) >= apart
        is_new &= _angles(places, vain, target).min(axis=1, initial=np.inf) >= config.vain
        return np.where(is_new, share, 0.0)

    def _is_open(self, camera: NDArray[np.float64], target: NDArray[np.float64], body: cKDTree) -> bool:
        """Whether all between a camera (3,) and a victim is known to be free: up to its feet, if they come first."""
        length = np.linalg.norm(target - camera)
        along = np.arange(_HERE, length, _STEP) / length
        line = camera + along[:, None] * (target - camera)
        to_body, _ = body.query(line)
        before = np.logical_and.accumulate(to_body > self.config.margin)
        return bool((self._map.state_at(line[before]) == FREE).all())


def _distances(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, M) m between places (N, 2 or 3) and (M, 2), seen from above."""
    return np.linalg.norm(a[:, None, :2] - b, axis=2)


def _angles(
    a: NDArray[np.float64], b: NDArray[np.float64], target: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, M) rad between places (N, 2 or 3) and (M, 2) as seen from a target (3,)."""
    to_a, to_b = a[:, :2] - target[:2], b - target[:2]
    bearing_a, bearing_b = np.arctan2(to_a[:, 1], to_a[:, 0]), np.arctan2(to_b[:, 1], to_b[:, 0])
    return np.abs(wrap_angles(bearing_a[:, None] - bearing_b))
