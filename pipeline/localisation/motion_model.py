"""The robot's motion from odometry, corrected for the systematic errors that the pose graph has estimated so far.

The gyro's scale, the radius of the tyres, the centre of rotation, and the slide of a robot that turns on a slope are
constants that no data sheet gives accurately enough. They are variables of the pose graph, so every return to a known
place corrects them, and all earlier motions with them.
"""

from dataclasses import dataclass
from functools import cached_property

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from pipeline.arrays import Covariance, Direction, Information, Pose, Values
from pipeline.localisation.config import OdometryConfig
from pipeline.localisation.localisation import OdometryErrors
from pipeline.transforms import from_rotation, inverse, orthonormal

MIN_UPRIGHT = np.cos(np.pi / 4)
"""Minimum cosine between a turn's axis and the vertical for the robot to have turned about this axis."""
POSE_SLICE, ERRORS_SLICE = slice(6), slice(6, None)
"""Slices of the pose and of the systematic errors in their joint covariance (13, 13)."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """The motion between two times as measured by the odometry.

    Attributes:
        T: pose after the motion, in ``base_link`` before it.
        up: the vertical in ``base_link`` before the motion.
        duration: time that the motion took, s.
        turned: rotation about the vertical, including full turns, rad.
    """

    T: Pose
    up: Direction
    duration: float
    turned: float = 0.0

    @cached_property
    def shortest_turn(self) -> NDArray[np.float64]:
        """(3,) rotation vector without full turns, rad."""
        return Rotation.from_matrix(self.T[:3, :3]).as_rotvec()

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(3,) rotation vector, rad; its length exceeds π after more than half a turn.

        Full turns are about the axis of the shortest turn or, if this axis is far from vertical, about the vertical.
        After a full turn, the shortest turn may be zero, or may be only the change of the robot's tilt.
        """
        turn = self.shortest_turn
        length, upwards = np.linalg.norm(turn), turn @ self.up
        whole = 2 * np.pi * np.round((self.turned - upwards) / (2 * np.pi))
        if not whole:
            return turn
        is_upright = abs(upwards) > MIN_UPRIGHT * length
        return turn + whole * (turn / np.copysign(length, upwards) if is_upright else self.up)

    @cached_property
    def translation_jacobian(self) -> NDArray[np.float64]:
        """(3, 7) Jacobian of the translation, m, in ``base_link`` before the motion, w.r.t. the systematic errors."""
        nothing, centre = np.zeros(3), np.eye(3)[0] - self.T[:3, 0]
        return np.stack([self.T[:3, 3], nothing, centre, *self._slides, nothing], axis=1)

    @property
    def _slides(self) -> NDArray[np.float64]:
        """(3, 3) m, displacements by the three parts of a slide on a slope: downhill, along the axle, of the pivot.

        Let g be the downhill vector, ψ the turn about z, and x and y the axes of ``base_link`` as they turn. The
        parts are the integrals over ψ of g, (g · y) y and -(g · x) y. The first two do not depend on the sense of the
        turn. In complex numbers, 2 (g · y) y = g - e^(2iψ) g* and 2 (g · x) y = i (g + e^(2iψ) g*).
        """
        turn, downhill = self.turn[2], -complex(*self.up[:2])
        straight, turning = turn * downhill, np.sin(turn) * np.exp(1j * turn) * downhill.conjugate()
        sign = np.sign(turn)
        parts = sign * straight, sign * (straight - turning) / 2, -1j * (straight + turning) / 2
        return np.array([(part.real, part.imag, 0.0) for part in parts])

    @cached_property
    def rotation_jacobian(self) -> NDArray[np.float64]:
        """(3, 7) Jacobian of the rotation vector, rad, w.r.t. the systematic errors."""
        nothing = np.zeros(3)
        return np.stack([nothing, self.turn, *np.zeros((4, 3)), self.duration * np.eye(3)[2]], axis=1)

    def without(self, errors: Values) -> Pose:
        """The pose after the motion, in ``base_link`` before it, corrected for systematic errors (7,)."""
        R = Rotation.from_rotvec(self.shortest_turn + self.rotation_jacobian @ errors).as_matrix()
        return from_rotation(R, self.T[:3, 3] + self.translation_jacobian @ errors)

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """(6, 7) Jacobian of the pose after the motion, in its tangent space, w.r.t. the systematic errors."""
        return np.vstack([self.rotation_jacobian, self.T[:3, :3].T @ self.translation_jacobian])

    def noise(self, config: OdometryConfig) -> Covariance:
        """Covariance of the pose after the motion, without the part due to the systematic errors."""
        way, turn, slope = (float(np.linalg.norm(v)) for v in (self.T[:3, 3], self.turn, self.up[:2]))
        vertical = np.outer(self.up, self.up)
        tilt = 2 * config.gravity_sigma**2 * (np.eye(3) - vertical)  # of roll and pitch before and after the motion
        slide = config.slide_noise * slope * turn  # also where the robot only pitches: it may drop off an edge
        translation = config.translation_sigma**2 * (way + turn + config.added_distance) + slide**2
        heading = (config.turn_sigma + config.turn_sigma_per_rad * turn) ** 2 * vertical
        # Occasionally, the wheels slip unnoticed, by up to the whole distance.
        slip = way / config.distance_between_slips * np.outer(self.T[:3, 3], self.T[:3, 3]) / 3
        return np.asarray(block_diag(heading + tilt, translation * np.eye(3) + slip))


@dataclass(frozen=True, eq=False)
class Prediction:
    """The robot's pose as predicted by the odometry.

    Attributes:
        motion: motion since the reference.
        T_map_base: predicted pose.
        covariance: (13, 13) joint covariance of the pose relative to the map, in its tangent space, and of the
            systematic errors.
        motion_covariance: covariance of the pose from the motion alone, as if the pose before the motion were exact.
    """

    motion: MeasuredMotion
    T_map_base: Pose
    covariance: Covariance
    motion_covariance: Covariance


class MotionModel:
    """Predicts motion from odometry, corrected for the systematic errors estimated so far.

    Attributes:
        errors: (7,) systematic errors, see :class:`pipeline.localisation.localisation.OdometryErrors`.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config, self._covariance = config, np.zeros((6, 6))
        self.learn(OdometryErrors.expected(config))

    def predict(self, T_map_base: Pose, motion: MeasuredMotion) -> Prediction:
        """Predict the pose after a motion that starts at the reference's pose ``T_map_base``."""
        delta, J, noise = motion.without(self.errors), motion.jacobian, motion.noise(self._config)
        F = np.block([[gtsam.Pose3(inverse(delta)).AdjointMap(), J], [np.zeros_like(J.T), np.eye(len(self.errors))]])
        covariance = F @ self._covariance @ F.T
        covariance[POSE_SLICE, POSE_SLICE] += noise
        motion_covariance = noise + J @ self._covariance[ERRORS_SLICE, ERRORS_SLICE] @ J.T
        return Prediction(motion, orthonormal(T_map_base @ delta), covariance, motion_covariance)

    def update(self, prediction: Prediction, information: Information | None) -> None:
        """Continue from a predicted pose, whose covariance follows from the motion and from registration.

        ``information``: information of the pose from registration; None if nothing was registered.

        Errors accumulate only while nothing is registered. Even in directions that surfaces do not determine, such as
        along a corridor, the pose relative to the surfaces of the last keyframe is only as uncertain as the last
        motion.
        """
        if information is None:
            self._covariance = prediction.covariance
        else:
            self.restart(np.asarray(np.linalg.inv(information + np.linalg.inv(prediction.motion_covariance))))

    def restart(self, covariance: Covariance) -> None:
        """Continue from a pose with this covariance, whatever the odometry measured."""
        self._covariance = block_diag(covariance, self._covariance[ERRORS_SLICE, ERRORS_SLICE])

    def learn(self, odometry: OdometryErrors) -> None:
        """Correct all further motions for newly estimated systematic errors of the odometry."""
        self.errors = odometry.errors
        self._covariance = block_diag(self._covariance[POSE_SLICE, POSE_SLICE], odometry.covariance)
