"""How the robot moves by its odometry, and what is wrong with that, learnt while it drives.

A gyro's scale, the radius of tyres, the centre of a turn and how far the robot slides in turns on a slope are
constants that no data sheet tells well enough. An extended Kalman filter estimates them together with the pose: what
registration finds after a blind turn tells how wrong the gyro's scale is, and that the turn before was as wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from pipeline.localisation.pose_graph import GYRO_SIGMA, Drive
from pipeline.localisation.registration import Prior, Registration, logarithm
from pipeline.transforms import from_rotation, inverse, orthonormal

MEAN = 0.0, 0.0, 0.0, 0.4, 0.0
"""Of the relative errors of the way and of the turn, of the centre of turns before ``base_link`` in m, of the slide
downhill in m per rad turned, times the sine of the tilt, and of the yaw rate in rad/s."""
SIGMA = 0.02, GYRO_SIGMA[0], 0.02, 0.2, GYRO_SIGMA[1]
"""Standard deviations of these before anything is learnt."""
MEMORY = 1000, 1000, 1000, 1000, 100
"""Keyframes after which these may be as different as they were unknown at first; floors, tyres and gyros change."""
GYRO = [1, 4]
"""Of these, the gyro's: its scale and its bias. They are constant in truth, so the pose graph estimates them too."""
TURN_SIGMA = 1e-3, 3e-3
"""rad, and rad per rad turned: standard deviation of the odometry's rotation between keyframes, beside that."""
GYRO_TURN_SIGMA = 3e-4, 1e-3
"""The same beside errors of the gyro that are estimated along: what one motion alone adds, with the wander of
the bias. Of the simulated gyro 2e-4 was measured."""
WAY_SIGMA = 0.003, 0.015, 0.01
"""m, m per m driven and m per rad turned: of its translation. Skid-steered wheels slide in turns."""
SLIDE_SIGMA = 0.2
"""m per rad turned, times the sine of the tilt: of the slide."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What the odometry tells of the motion between two moments.

    Attributes:
        T: 4×4 pose after it in ``base_link`` before it.
        up: (3,) the vertical in ``base_link`` before it.
        time: s that it took.
        turned: rad about the vertical, whole turns counted.
    """

    T: NDArray[np.float64]
    up: NDArray[np.float64]
    time: float
    turned: float = 0.0

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(3,) rotation vector, rad, longer than π after more than half a turn."""
        turn = Rotation.from_matrix(self.T[:3, :3]).as_rotvec()
        whole = 2 * np.pi * np.round((self.turned - turn @ self.up) / (2 * np.pi))
        return turn + whole * turn / (turn @ self.up) if whole else turn

    @property
    def moves(self) -> NDArray[np.float64]:
        """(3, 5) m by which one of each parameter moves the robot, in ``base_link`` before the motion."""
        slide = -np.linalg.norm(self.turn) * np.append(self.up[:2], 0.0)
        nothing = np.zeros(3)
        return np.stack([self.T[:3, 3], nothing, np.eye(3)[0] - self.T[:3, 0], slide, nothing], axis=1)

    @property
    def turns(self) -> NDArray[np.float64]:
        """(3, 5) rad by which one of each parameter turns it."""
        nothing = np.zeros(3)
        return np.stack([nothing, self.turn, nothing, nothing, self.time * np.eye(3)[2]], axis=1)

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """(6, 5) derivative of the pose after the motion, rad and m in the tangent there, by the parameters."""
        return np.vstack([self.turns, self.T[:3, :3].T @ self.moves])


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where the robot is by the odometry.

    Attributes:
        motion: that leads there.
        T_map_base: 4×4.
        covariance: (11, 11) of the pose, in its tangent, and of the parameters.
        step: (6, 6) covariance of the motion alone, as if the pose before it were known.
    """

    motion: Motion
    T_map_base: NDArray[np.float64]
    covariance: NDArray[np.float64]
    step: NDArray[np.float64]

    @property
    def prior(self) -> Prior:
        """Of the pose."""
        return Prior(self.T_map_base, np.asarray(np.linalg.inv(self.covariance[:6, :6])))


class MotionModel:
    """The motion between keyframes by the odometry, less the errors that are known so far.

    Attributes:
        parameters: (5,) see ``MEAN``.
    """

    def __init__(self) -> None:
        self.parameters = np.array(MEAN)
        self._covariance = block_diag(np.zeros((6, 6)), np.diag(np.array(SIGMA) ** 2))

    def predict(self, T_map_base: NDArray[np.float64], motion: Motion) -> Prediction:
        """Where a motion leads that begins at the newest keyframe's pose (4×4)."""
        delta, J = self._delta(motion, self.parameters), motion.jacobian
        F = np.block([[gtsam.Pose3(inverse(delta)).AdjointMap(), J], [np.zeros((5, 6)), np.eye(5)]])
        noise = _noise(motion)
        covariance = F @ self._covariance @ F.T + block_diag(noise, np.diag(np.array(SIGMA) ** 2 / MEMORY))
        return Prediction(
            motion, orthonormal(T_map_base @ delta), covariance, noise + J @ self._covariance[6:, 6:] @ J.T
        )

    def by_gyro(self, motion: Motion) -> Drive:
        """A motion, and what errors of the gyro would make of it."""
        parameters = self.parameters.copy()
        parameters[GYRO] = 0.0
        return Drive(self._delta(motion, parameters), motion.jacobian[:, GYRO], _noise(motion, GYRO_TURN_SIGMA))

    def take(self, prediction: Prediction, registration: Registration | None) -> None:
        """Make a keyframe of a prediction, and learn from how far off it was registered, if it was."""
        C = prediction.covariance
        if registration is not None:
            P, H = prediction.prior.information, registration.information
            off = logarithm(np.linalg.solve(prediction.T_map_base, registration.T))
            self.parameters = self.parameters + C[6:, :6] @ P @ off
            gain = P @ np.linalg.solve(P + H, H)
            C = C - C[:, :6] @ (gain + gain.T) / 2 @ C[:6]
        self._covariance = C

    def fit(self, motions: Sequence[Motion | None], poses: NDArray[np.float64]) -> None:
        """Learn from poses of keyframes (K, 4, 4), m in ``map``, that a loop has corrected.

        ``motions`` are those to each of them from the one before, None where the odometry is not to be believed.
        """
        known = np.diag(np.array(SIGMA) ** -2.0)
        pull = known @ (MEAN - self.parameters)
        for before, after, motion in zip(poses, poses[1:], motions[1:], strict=False):
            if motion is not None:
                weighted = motion.jacobian.T @ np.linalg.inv(_noise(motion))
                known = known + weighted @ motion.jacobian
                pull += weighted @ logarithm(np.linalg.solve(before @ self._delta(motion, self.parameters), after))
        self.parameters = self.parameters + np.linalg.solve(known, pull)

    def _delta(self, motion: Motion, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """4×4 motion without the errors that are known."""
        R = Rotation.from_rotvec(motion.turn + motion.turns @ parameters).as_matrix()
        return from_rotation(R, motion.T[:3, 3] + motion.moves @ parameters)

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Make a keyframe whose pose is known with this covariance (6, 6), rad² and m², whatever odometry says."""
        self._covariance = block_diag(covariance, self._covariance[6:, 6:])


def _noise(motion: Motion, turn_sigma: tuple[float, float] = TURN_SIGMA) -> NDArray[np.float64]:
    """(6, 6) covariance of a motion beside the constant errors, rad² and m²."""
    way, turn, slope = (float(np.linalg.norm(v)) for v in (motion.T[:3, 3], motion.turn, motion.up[:2]))
    rotation = turn_sigma[0] + turn_sigma[1] * turn
    translation = WAY_SIGMA[0] + WAY_SIGMA[1] * way + (WAY_SIGMA[2] + SLIDE_SIGMA * slope) * turn
    return np.diag(np.repeat([rotation, translation], 3) ** 2)
