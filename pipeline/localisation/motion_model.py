"""The robot's motion by its odometry, whose systematic errors are estimated while the robot drives.

The gyro's scale, the radius of tyres, the centre of a turn and how far the robot slides in turns on a slope are
constants that no data sheet gives accurately enough. An extended Kalman filter estimates them together with the pose:
when a registration corrects the heading after a blind turn, it corrects the gyro's scale as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from pipeline.localisation.pose_graph import GYRO_SIGMA, OdometryMotion
from pipeline.localisation.registration import Prior, Registration, logarithm
from pipeline.transforms import from_rotation, inverse, orthonormal

MEAN = 0.0, 0.0, 0.0, 0.4, 0.0
"""Initial parameters: relative errors of the way and of the turn, the centre of turns ahead of ``base_link`` in m,
the slide downhill in m per rad turned and times the sine of the tilt, and the error of the yaw rate in rad/s."""
SIGMA = 0.02, GYRO_SIGMA[0], 0.02, 0.2, GYRO_SIGMA[1]
"""Initial standard deviations of the parameters."""
ERROR_MEMORY = 1000
"""Keyframes in which a parameter's process noise adds up to its initial variance: floors, tyres and gyros change."""
POSE, PARAMETERS = slice(6), slice(6, None)
"""Parts of a joint covariance (11, 11)."""
GYRO = [1, -1]
"""Indices of the gyro's parameters, scale and bias. In truth they are constant: the pose graph estimates them too."""
TURN_SIGMA = 1e-3, 3e-3
"""rad, and rad per rad turned: standard deviation of the odometry's rotation beyond errors of the parameters."""
GYRO_TURN_SIGMA = 3e-4, 1e-3
"""The same in the pose graph, which estimates the gyro's errors: the noise of a single motion, with the random walk
of the bias. For the simulated gyro 2e-4 was measured."""
WAY_SIGMA = 0.003, 0.015, 0.01
"""m, m per m driven and m per rad turned: standard deviation of the translation: skid-steered wheels slide."""
SLIDE_SIGMA = 0.5
"""m per rad turned, times the sine of the tilt: standard deviation of the slide; 0.45 was measured on half ramps."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """The motion between two moments as the odometry measures it.

    Attributes:
        T: 4×4 pose after the motion in ``base_link`` before it.
        up: (3,) the vertical in ``base_link`` before the motion.
        time: duration, s.
        turned: rotation about the vertical, whole turns counted, rad.
    """

    T: NDArray[np.float64]
    up: NDArray[np.float64]
    time: float
    turned: float = 0.0

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(3,) rotation vector, rad; its length exceeds π after more than half a turn."""
        turn = Rotation.from_matrix(self.T[:3, :3]).as_rotvec()
        whole = 2 * np.pi * np.round((self.turned - turn @ self.up) / (2 * np.pi))
        return turn + whole * turn / np.copysign(np.linalg.norm(turn), turn @ self.up) if whole else turn

    @property
    def moves(self) -> NDArray[np.float64]:
        """(3, 5) derivative of the translation, m, by the parameters, in ``base_link`` before the motion."""
        slide = -np.linalg.norm(self.turn) * np.append(self.up[:2], 0.0)
        nothing = np.zeros(3)
        return np.stack([self.T[:3, 3], nothing, np.eye(3)[0] - self.T[:3, 0], slide, nothing], axis=1)

    @property
    def turns(self) -> NDArray[np.float64]:
        """(3, 5) derivative of the rotation vector, rad, by the parameters."""
        nothing = np.zeros(3)
        return np.stack([nothing, self.turn, nothing, nothing, self.time * np.eye(3)[2]], axis=1)

    @property
    def drive(self) -> OdometryMotion:
        """The motion for the pose graph."""
        return OdometryMotion(self.T, self.moves, self.jacobian[:, GYRO], _noise(self, GYRO_TURN_SIGMA))

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """(6, 5) derivative of the pose after the motion, rad and m in the tangent there, by the parameters."""
        return np.vstack([self.turns, self.T[:3, :3].T @ self.moves])


@dataclass(frozen=True, eq=False)
class Prediction:
    """The robot's pose as predicted by the odometry.

    Attributes:
        motion: since the newest keyframe.
        T_map_base: 4×4 predicted pose.
        covariance: (11, 11) of the pose, in its tangent, and of the parameters.
        step: (6, 6) covariance of the motion alone, as if the pose before it were known.
    """

    motion: MeasuredMotion
    T_map_base: NDArray[np.float64]
    covariance: NDArray[np.float64]
    step: NDArray[np.float64]

    @property
    def prior(self) -> Prior:
        """The predicted pose as a Gaussian."""
        return Prior(self.T_map_base, np.asarray(np.linalg.inv(self.covariance[POSE, POSE])))


class MotionModel:
    """Predicts motion between keyframes by the odometry, corrected by the errors estimated so far.

    Attributes:
        parameters: (5,) see ``MEAN``.
    """

    def __init__(self) -> None:
        self.parameters = np.array(MEAN)
        self._covariance = np.diag(np.concatenate([np.zeros(6), np.square(SIGMA)]))

    def predict(self, T_map_base: NDArray[np.float64], motion: MeasuredMotion) -> Prediction:
        """The pose after a motion from the newest keyframe's pose (4×4)."""
        delta, J = self._delta(motion, self.parameters), motion.jacobian
        F = np.block([[gtsam.Pose3(inverse(delta)).AdjointMap(), J], [np.zeros_like(J.T), np.eye(len(MEAN))]])
        noise = _noise(motion)
        covariance = F @ self._covariance @ F.T + block_diag(noise, np.diag(np.array(SIGMA) ** 2 / ERROR_MEMORY))
        return Prediction(
            motion,
            orthonormal(T_map_base @ delta),
            covariance,
            noise + J @ self._covariance[PARAMETERS, PARAMETERS] @ J.T,
        )

    def take(self, prediction: Prediction, registration: Registration | None) -> None:
        """Make a keyframe of a prediction; if it was registered, learn from the error of the prediction."""
        C = prediction.covariance
        if registration is not None:
            P, H = prediction.prior.information, registration.information
            off = logarithm(np.linalg.solve(prediction.T_map_base, registration.T))
            self.parameters = self.parameters + C[PARAMETERS, POSE] @ P @ off
            gain = P @ np.linalg.solve(P + H, H)
            C = C - C[:, POSE] @ (gain + gain.T) / 2 @ C[POSE]
        self._covariance = C

    def fit(self, motions: Sequence[MeasuredMotion | None], poses: NDArray[np.float64]) -> None:
        """Estimate the parameters from poses of keyframes (K, 4, 4), m in ``map``, that a loop has corrected.

        ``motions[k]`` leads from keyframe k - 1 to keyframe k; it is None if the odometry cannot be trusted there.
        """
        known = np.diag(np.array(SIGMA) ** -2.0)
        pull = known @ (MEAN - self.parameters)
        for before, after, motion in zip(poses, poses[1:], motions[1:], strict=False):
            if motion is not None:
                weighted = motion.jacobian.T @ np.linalg.inv(_noise(motion))
                known = known + weighted @ motion.jacobian
                pull += weighted @ logarithm(np.linalg.solve(before @ self._delta(motion, self.parameters), after))
        self.parameters = self.parameters + np.linalg.solve(known, pull)

    def _delta(self, motion: MeasuredMotion, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """4×4 motion, corrected by the parameters."""
        R = Rotation.from_rotvec(motion.turn + motion.turns @ parameters).as_matrix()
        return from_rotation(R, motion.T[:3, 3] + motion.moves @ parameters)

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Make a keyframe whose pose has this covariance (6, 6), rad² and m², whatever the odometry measured."""
        self._covariance = block_diag(covariance, self._covariance[PARAMETERS, PARAMETERS])


def _noise(motion: MeasuredMotion, turn_sigma: tuple[float, float] = TURN_SIGMA) -> NDArray[np.float64]:
    """(6, 6) covariance of a motion apart from errors of the parameters, rad² and m²."""
    way, turn, slope = (float(np.linalg.norm(v)) for v in (motion.T[:3, 3], motion.turn, motion.up[:2]))
    rotation = turn_sigma[0] + turn_sigma[1] * turn
    translation = WAY_SIGMA[0] + WAY_SIGMA[1] * way + (WAY_SIGMA[2] + SLIDE_SIGMA * slope) * turn
    return np.diag(np.repeat([rotation, translation], 3) ** 2)
