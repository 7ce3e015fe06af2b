"""Likelihoods of a frame if the robot moved as measured, slipped, or was held in place."""

from collections.abc import Sequence

import numpy as np
import small_gicp
from scipy.linalg import block_diag

from pipeline.arrays import Pose, Values
from pipeline.frame import Frame
from pipeline.localisation.belief import (
    MotionState,
    overlap_log_likelihood_ratio,
    tiles_covered,
    view_log_likelihoods,
)
from pipeline.localisation.config import LocalisationConfig, RegistrationConfig
from pipeline.localisation.loops import points_in_view
from pipeline.localisation.registration import Prior, Registration, Target, exponential, register

HELD_SIGMA = 0.02
"""Standard deviation of the position of a held robot, and of the sideways position of a slipping robot, m."""


def log_likelihoods(
    found: Sequence[Registration], target: Target, frame: Frame, config: RegistrationConfig
) -> Values:
    """(N,) log-likelihoods of a frame under the priors of its registrations, up to a common constant.

    The registrations are compared by the fraction of the old points in view that the frame shows. These points are
    treated as covering the same part of the image at every pose; otherwise, a frame that shows none of them would
    favour the pose with the fewest in view. The fraction of the frame's points that were seen before is less
    informative: along a corridor, a robot that has moved sees new ground, but registered at its old place, it would
    seem to see only known ground.

    All registrations share the strongest evidence that one of them is correct. Two kinds of evidence are used,
    because new ground weakens one of them, and hidden old ground weakens the other.
    """
    chance = config.chance_overlap
    shown, covered, evidence = np.zeros(len(found)), np.empty(len(found)), []
    for n, registration in enumerate(found):
        pixels, z, depth = points_in_view(frame, registration.T, target.points)
        if len(z):
            shown[n] = np.mean(np.abs(depth - z) < config.fine)
        covered[n] = tiles_covered(pixels, frame.intrinsics.width)
        evidence += [overlap_log_likelihood_ratio(shown[n], chance, covered[n])]
        evidence += [overlap_log_likelihood_ratio(registration.overlap, chance)]
    compared = view_log_likelihoods(shown, covered.min())
    surprise = np.array([registration.surprise for registration in found])
    return np.asarray(compared - compared.max() + max(evidence) - surprise)


def register_alternatives(
    target: Target,
    cloud: small_gicp.PointCloud,
    odometry: Prior,
    T_map_base: Pose,
    frame: Frame,
    config: LocalisationConfig,
) -> dict[MotionState, tuple[Prior, Registration]]:
    """Register a frame as if the robot had stayed at ``T_map_base``, and as if it had slipped.

    For a slip, which moves the robot no farther than measured, registration starts from both ``T_map_base`` and the
    pose that the odometry predicts.
    """
    held, slips = held_and_slipping_priors(odometry, T_map_base)

    def registered(*priors: Prior) -> Registration:
        level = gravity_prior(priors[-1].T, frame, config.odometry.gravity_sigma)
        return register(target, cloud, [*priors, level], config.registration.coarse, config.registration)

    begins = (Prior(prior.T, np.zeros_like(slips.information)) for prior in (held, odometry))
    slipped = [registered(begin, slips) for begin in begins]
    likeliest = int(log_likelihoods(slipped, target, frame, config.registration).argmax())
    return {MotionState.HELD: (held, registered(held)), MotionState.SLIPPING: (slips, slipped[likeliest])}


def held_and_slipping_priors(odometry: Prior, T_map_base: Pose) -> tuple[Prior, Prior]:
    """Priors of the pose if the robot has stayed at ``T_map_base``, and if it has moved no farther than measured.

    Slipping wheels move the robot less far than they measure, and hardly move it sideways.
    """
    stayed = odometry.T.copy()
    stayed[:3, 3] = T_map_base[:3, 3]
    way = odometry.T[:3, :3].T @ (odometry.T[:3, 3] - stayed[:3, 3])
    rotation = np.linalg.inv(np.linalg.inv(odometry.information)[:3, :3])
    still = HELD_SIGMA**2 * np.eye(3)
    held = Prior(stayed, block_diag(rotation, np.linalg.inv(still)))
    return held, Prior(odometry.T, block_diag(rotation, np.linalg.inv(still + np.outer(way, way))))


def gravity_prior(T: Pose, frame: Frame, sigma: float) -> Prior:
    """A prior of roll and pitch alone, with a standard deviation of ``sigma`` rad.

    The prior's mean is the pose ``T``, rotated so that the vertical agrees with the odometry.
    """
    up = frame.T_odom_base[2, :3]
    level = T @ exponential(np.append(np.cross(up, T[2, :3]), np.zeros(3)))
    tilt = (np.eye(3) - np.outer(up, up)) / sigma**2
    return Prior(level, block_diag(tilt, np.zeros((3, 3))))
