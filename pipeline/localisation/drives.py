"""The motions by odometry between consecutive keyframes, as constraints of the pose graph."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Indices, Poses, Values
from pipeline.localisation.config import OdometryConfig
from pipeline.localisation.motion_model import MeasuredMotion


class Drives(NamedTuple):
    """Motions by odometry as constraints between keyframes, all of which are evaluated at once.

    Attributes:
        end: (M,) number of the keyframe at the end of each motion; it begins at the one before.
        T: (M, 4, 4) the motions as measured.
        turn: (M, 3) see :class:`MeasuredMotion`, as ``moves``, ``turns`` and ``jacobian``.
        whitening: (M, 6, 6) roots of their information: with it, every residual has a standard deviation of 1.
    """

    end: Indices
    T: Poses
    turn: NDArray[np.float64]
    moves: NDArray[np.float64]
    turns: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    whitening: NDArray[np.float64]

    @classmethod
    def none(cls) -> "Drives":
        """No motion yet."""
        shapes = (4, 4), (3,), (3, 5), (3, 5), (6, 5), (6, 6)
        return cls(np.zeros(0, np.int64), *(np.zeros((0, *shape)) for shape in shapes))

    def and_to(self, keyframe: int, motion: MeasuredMotion, config: OdometryConfig) -> "Drives":
        """These and the motion to a keyframe from the one before it."""
        whitening = np.linalg.inv(np.linalg.cholesky(motion.noise(config)))
        last = keyframe, motion.T, motion.turn, motion.moves, motion.turns, motion.jacobian, whitening
        return Drives(*(np.concatenate([those, np.array([this])]) for those, this in zip(self, last, strict=True)))

    def residuals(self, poses: Poses, errors: Values) -> NDArray[np.float64]:
        """(M, 6) how far keyframes' poses are from the motions corrected by systematic errors (5,).

        In rad and m, in the tangent after each motion, times its ``whitening``.
        """
        R = Rotation.from_rotvec(self.turn + self.turns @ errors).as_matrix().swapaxes(1, 2)
        between = self._between(poses)
        turned = Rotation.from_matrix(R @ between[:, :3, :3]).as_rotvec()
        moved = R @ (between[:, :3, 3] - self.T[:, :3, 3] - self.moves @ errors)[..., None]
        return np.asarray(np.squeeze(self.whitening @ np.concatenate([turned[..., None], moved], axis=1), -1))

    def jacobians(self, poses: Poses) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Derivatives (M, 6, 6 or 5) of the residuals by the poses before and after, and by the systematic errors.

        Those by a pose are per rad and m in its tangent.
        """
        before = adjoints(np.asarray(np.linalg.inv(self._between(poses)), np.float64))
        return -self.whitening @ before, self.whitening, -self.whitening @ self.jacobian

    def _between(self, poses: Poses) -> Poses:
        return np.asarray(np.linalg.inv(poses[self.end - 1]) @ poses[self.end])


def adjoints(T: Poses) -> NDArray[np.float64]:
    """(N, 6, 6) matrices that turn tangents, rad and m, at transforms into tangents at the identity."""
    result = np.zeros((len(T), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = R = T[:, :3, :3]
    result[:, 3:, :3] = np.cross(T[:, :3, 3:], R, axis=1)
    return result
