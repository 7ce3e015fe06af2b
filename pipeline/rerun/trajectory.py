"""The trajectory of a robot, thinned for drawings."""

import numpy as np
from numpy.typing import NDArray

from pipeline.localisation.localisation import Localisation
from pipeline.rerun.drawings import GRAIN
from pipeline.transforms import inverse


class DrawnTrajectory:
    """The trajectory driven so far.

    Attributes:
        distance: its length, m.
        positions: (3,) m each, successive ones at least ``GRAIN`` apart.
    """

    def __init__(self) -> None:
        self.distance = 0.0
        self.positions: list[NDArray[np.float64]] = []
        self._last: NDArray[np.float64] | None = None

    def add(self, position: NDArray[np.float64]) -> bool:
        """Extend the trajectory to ``position`` (3,) m; returns whether it became one of :attr:`positions`."""
        if self._last is not None:
            self.distance += float(np.linalg.norm(position - self._last))
        self._last = position.copy()
        if self.positions and np.linalg.norm(position - self.positions[-1]) < GRAIN:
            return False
        self.positions.append(self._last)
        return True


class CorrectedTrajectory:
    """The trajectory driven so far; when keyframes are corrected, each point moves with the keyframe before it."""

    def __init__(self) -> None:
        self._odometry = DrawnTrajectory()
        self._keyframes: list[int] = []
        self._positions: list[NDArray[np.float64]] = []

    @property
    def distance(self) -> float:
        """m by odometry, because a correction is not driven."""
        return self._odometry.distance

    def add(self, T_odom_base: NDArray[np.float64], localisation: Localisation | None) -> None:
        """Extend the trajectory to a 4×4 pose; before the first keyframe only the distance grows."""
        if not self._odometry.add(T_odom_base[:3, 3]) or localisation is None:
            return
        keyframe = len(localisation.poses) - 1
        T_keyframe_odom = inverse(localisation.poses[keyframe]) @ localisation.T_map_odom
        self._keyframes.append(keyframe)
        self._positions.append((T_keyframe_odom @ T_odom_base)[:3, 3])

    def positions(self, T_map_base: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) m in ``map``, given the (K, 4, 4) present estimates of the keyframes' poses."""
        T = T_map_base[self._keyframes]
        return np.einsum("nij,nj->ni", T[:, :3, :3], np.reshape(self._positions, (-1, 3))) + T[:, :3, 3]
