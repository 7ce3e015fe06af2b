"""The trajectory of a robot, thinned for drawings."""

import numpy as np

from pipeline.arrays import Place, Places, Pose, Poses
from pipeline.localisation.localisation import Localisation
from pipeline.transforms import inverse


class DrawnTrajectory:
    """The trajectory driven so far, thinned.

    Attributes:
        distance: length of the trajectory, m.
        positions: positions along the trajectory; successive positions are at least ``spacing`` m apart.
    """

    def __init__(self, spacing: float) -> None:
        """Start without positions; ``spacing``: minimum distance between successive positions, m."""
        self.distance = 0.0
        self.positions: list[Place] = []
        self._spacing = spacing
        self._last: Place | None = None

    def add(self, position: Place) -> bool:
        """Extend the trajectory to a position; True if the position was added to :attr:`positions`."""
        if self._last is not None:
            self.distance += float(np.linalg.norm(position - self._last))
        self._last = position.copy()
        if self.positions and np.linalg.norm(position - self.positions[-1]) < self._spacing:
            return False
        self.positions.append(self._last)
        return True


class CorrectedTrajectory:
    """The trajectory driven so far; when keyframes are corrected, each point moves with the keyframe before it."""

    def __init__(self, spacing: float) -> None:
        """Start without positions; ``spacing``: minimum distance between successive positions, m."""
        self._odometry = DrawnTrajectory(spacing)
        self._keyframes: list[int] = []
        self._positions: list[Place] = []

    @property
    def distance(self) -> float:
        """Distance driven according to the odometry, m; corrections of keyframes do not change the distance."""
        return self._odometry.distance

    def add(self, T_odom_base: Pose, localisation: Localisation | None) -> None:
        """Extend the trajectory to a pose; before the first keyframe, only the distance grows."""
        if not self._odometry.add(T_odom_base[:3, 3]) or localisation is None:
            return
        keyframe = len(localisation.poses) - 1
        T_keyframe_odom = inverse(localisation.poses[keyframe]) @ localisation.T_map_odom
        self._keyframes.append(keyframe)
        self._positions.append((T_keyframe_odom @ T_odom_base)[:3, 3])

    def positions(self, T_map_base: Poses) -> Places:
        """The thinned trajectory in ``map``, given the current estimates of the keyframes' poses."""
        T = T_map_base[self._keyframes]
        return np.einsum("nij,nj->ni", T[:, :3, :3], np.reshape(self._positions, (-1, 3))) + T[:, :3, 3]
