"""The robot's motion by its odometry, corrected by the systematic errors that the pose graph has found so far.

The gyro's scale, the radius of tyres, the centre of a turn and how far the robot slides in turns on a slope are
constants that no data sheet gives accurately enough. They are variables of the pose graph, so every return to a known
place corrects them, and with them each motion before.
"""

from dataclasses import dataclass
from functools import cached_property

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from pipeline.localisation.localisation import STILL_WAY, UNKNOWN_ODOMETRY, OdometryErrors
from pipeline.transforms import from_rotation, inverse, orthonormal

POSE, ERRORS = slice(6), slice(6, None)
"""Parts of a joint covariance (11, 11)."""
GRAVITY_SIGMA = np.deg2rad(0.3)
"""rad, standard deviation of a keyframe's roll and pitch by the odometry: the accelerometer's during a drive."""
TURN_SIGMA = 3e-4, 1e-3
"""rad, and rad per rad turned: standard deviation of the odometry's heading beyond its systematic errors, the noise
of a single motion, with the random walk of the gyro's bias. For the simulated gyro 2e-4 was measured."""
WAY_SIGMA = 0.005
"""m for 1 m driven or 1 rad turned: standard deviation of the translation of skid-steered wheels, whose errors are a
random walk: it grows with the root of both. In four simulated arenas 0.004 was measured on level ground."""
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

    @cached_property
    def moves(self) -> NDArray[np.float64]:
        """(3, 5) derivative of the translation, m, by the systematic errors, in ``base_link`` before the motion."""
        slide = -np.linalg.norm(self.turn) * np.append(self.up[:2], 0.0)
        nothing = np.zeros(3)
        return np.stack([self.T[:3, 3], nothing, np.eye(3)[0] - self.T[:3, 0], slide, nothing], axis=1)

    @cached_property
    def turns(self) -> NDArray[np.float64]:
        """(3, 5) derivative of the rotation vector, rad, by the systematic errors."""
        nothing = np.zeros(3)
        return np.stack([nothing, self.turn, nothing, nothing, self.time * np.eye(3)[2]], axis=1)

    def without(self, errors: NDArray[np.float64]) -> NDArray[np.float64]:
        """4×4 motion, corrected by systematic errors (5,)."""
        R = Rotation.from_rotvec(self.turn + self.turns @ errors).as_matrix()
        return from_rotation(R, self.T[:3, 3] + self.moves @ errors)

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """(6, 5) derivative of the pose after the motion, in the tangent there, by the systematic errors."""
        return np.vstack([self.turns, self.T[:3, :3].T @ self.moves])

    @cached_property
    def noise(self) -> NDArray[np.float64]:
        """(6, 6) covariance apart from systematic errors, rad² and m²."""
        way, turn, slope = (float(np.linalg.norm(v)) for v in (self.T[:3, 3], self.turn, self.up[:2]))
        vertical = np.outer(self.up, self.up)
        tilt = 2 * GRAVITY_SIGMA**2 * (np.eye(3) - vertical)  # of the levels before and after the motion
        translation = WAY_SIGMA**2 * (way + turn + STILL_WAY) + (SLIDE_SIGMA * slope * turn) ** 2
        heading = (TURN_SIGMA[0] + TURN_SIGMA[1] * turn) ** 2 * vertical
        return np.asarray(block_diag(heading + tilt, translation * np.eye(3)))


@dataclass(frozen=True, eq=False)
class Prediction:
    """The robot's pose as predicted by the odometry.

    Attributes:
        motion: since the reference.
        T_map_base: 4×4 predicted pose.
        covariance: (11, 11) of the pose relative to the map, in its tangent, and of the systematic errors.
        step: (6, 6) covariance of the motion alone, as if the pose before it were known.
    """

    motion: MeasuredMotion
    T_map_base: NDArray[np.float64]
    covariance: NDArray[np.float64]
    step: NDArray[np.float64]


class MotionModel:
    """Predicts motion by the odometry, corrected by the systematic errors found so far.

    Attributes:
        errors: (5,) see :class:`pipeline.localisation.localisation.OdometryErrors`.
    """

    def __init__(self) -> None:
        self._covariance = np.zeros((6, 6))
        self.learn(UNKNOWN_ODOMETRY)

    def predict(self, T_map_base: NDArray[np.float64], motion: MeasuredMotion) -> Prediction:
        """The pose after a motion from a reference's pose (4×4)."""
        delta, J = motion.without(self.errors), motion.jacobian
        F = np.block([[gtsam.Pose3(inverse(delta)).AdjointMap(), J], [np.zeros_like(J.T), np.eye(len(self.errors))]])
        covariance = F @ self._covariance @ F.T
        covariance[POSE, POSE] += motion.noise
        step = motion.noise + J @ self._covariance[ERRORS, ERRORS] @ J.T
        return Prediction(motion, orthonormal(T_map_base @ delta), covariance, step)

    def take(self, prediction: Prediction, information: NDArray[np.float64] | None) -> None:
        """Go on from a prediction's pose, which is as sure as its motion and what was registered make it.

        ``information`` (6, 6) of the surfaces, 1/rad² and 1/m²; None if nothing was registered.

        Errors add up only while nothing is registered: where surfaces say nothing along the way, as in a corridor, a
        pose is as uncertain relative to what the last keyframe saw as the last motion.
        """
        if information is None:
            self._covariance = prediction.covariance
        else:
            self.restart(np.asarray(np.linalg.inv(information + np.linalg.inv(prediction.step))))

    def restart(self, covariance: NDArray[np.float64]) -> None:
        """Go on from a pose with this covariance (6, 6), rad² and m², whatever the odometry measured."""
        self._covariance = block_diag(covariance, self._covariance[ERRORS, ERRORS])

    def learn(self, odometry: OdometryErrors) -> None:
        """Correct motions from now on by what is known of the odometry."""
        self.errors = odometry.errors
        self._covariance = block_diag(self._covariance[POSE, POSE], odometry.covariance)
