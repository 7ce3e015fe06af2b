"""The motions between consecutive keyframes as measured by odometry, as constraints of the pose graph."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Indices, Poses, Values
from pipeline.localisation.config import OdometryConfig
from pipeline.localisation.motion_model import MeasuredMotion


class Drives(NamedTuple):
    """Motions from odometry as constraints between keyframes, all evaluated at once.

    Attributes:
        end: (M,) index of the keyframe at the end of each motion, which starts at the keyframe before it.
        T: (M, 4, 4) the measured motions.
        turn, moves, turns, jacobian: see :class:`MeasuredMotion`; their first axis has length M.
        whitening: (M, 6, 6) square roots of the motions' information, which scale every residual's deviation to 1.
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

    def appended(self, keyframe: int, motion: MeasuredMotion, config: OdometryConfig) -> "Drives":
        """These motions, followed by the motion to a keyframe from the one before it."""
        whitening = np.linalg.inv(np.linalg.cholesky(motion.noise(config)))
        last = keyframe, motion.T, motion.turn, motion.moves, motion.turns, motion.jacobian, whitening
        return Drives(*(np.concatenate([those, np.array([this])]) for those, this in zip(self, last, strict=True)))

    def residuals(self, poses: Poses, errors: Values) -> NDArray[np.float64]:
        """(M, 6) deviations of the keyframes' poses from the motions, corrected for systematic errors (5,).

        In rad and m in the tangent space after each motion, multiplied by its ``whitening``.
        """
        R = Rotation.from_rotvec(self.turn + self.turns @ errors).as_matrix().swapaxes(1, 2)
        between = self._between(poses)
        turned = Rotation.from_matrix(R @ between[:, :3, :3]).as_rotvec()
        moved = R @ (between[:, :3, 3] - self.T[:, :3, 3] - self.moves @ errors)[..., None]
        return np.asarray(np.squeeze(self.whitening @ np.concatenate([turned[..., None], moved], axis=1), -1))

    def jacobians(self, poses: Poses) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Jacobians (M, 6, 6 or 5) of the residuals: with respect to the poses before and after, and to the errors.

        Those with respect to a pose are per rad and m in its tangent space.
        """
        before = adjoints(np.asarray(np.linalg.inv(self._between(poses)), np.float64))
        return -self.whitening @ before, self.whitening, -self.whitening @ self.jacobian

    def _between(self, poses: Poses) -> Poses:
        return np.asarray(np.linalg.inv(poses[self.end - 1]) @ poses[self.end])


def adjoints(T: Poses) -> NDArray[np.float64]:
    """(N, 6, 6) adjoint matrices, which map tangent vectors (rad, m) at the transforms to ones at the identity."""
    result = np.zeros((len(T), 6, 6))
    result[:, :3, :3] = result[:, 3:, 3:] = R = T[:, :3, :3]
    result[:, 3:, :3] = np.cross(T[:, :3, 3:], R, axis=1)
    return result
