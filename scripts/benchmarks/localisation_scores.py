"""Errors of a trajectory, without alignment, because ``map`` coincides with the world frame at the start."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Poses, Values
from pipeline.transforms import wrap_angle

RPE_DISTANCE = 1.0  # m, distance driven between the two poses of a relative pose error


def trajectory_scores(true: NDArray[np.float64], estimated: NDArray[np.float64]) -> dict[str, float]:
    """Errors of estimated (N, 4, 4) poses against true poses at the same times.

    - ``ate_m``: root mean square of the position error.
    - ``max_m``: maximum of the position error.
    - ``heading_deg``: root mean square of the yaw error.
    - ``rpe_m``, ``rpe_deg``: root mean squares of relative errors over ``RPE_DISTANCE`` (Sturm et al., IROS 2012).
    - ``drift_percent``: ratio of the final position error to the distance driven, in percent.
    """
    distance = np.linalg.norm(true[:, :3, 3] - estimated[:, :3, 3], axis=1)
    yaw, believed = (np.arctan2(T[:, 1, 0], T[:, 0, 0]) for T in (true, estimated))
    way = distances_driven(true)
    scores = {
        "ate_m": rms(distance),
        "max_m": float(distance.max()),
        "heading_deg": float(np.rad2deg(rms(wrap_angle(yaw - believed)))),
        "drift_percent": float(100 * distance[-1] / way[-1]) if way[-1] else 0.0,
    }
    first = np.flatnonzero(way <= way[-1] - RPE_DISTANCE)
    if len(first):
        last = np.searchsorted(way, way[first] + RPE_DISTANCE)
        errors = errors_of(relative_poses(true, first, last), relative_poses(estimated, first, last))
        scores["rpe_m"] = rms(np.linalg.norm(errors[:, 3:], axis=1))
        scores["rpe_deg"] = float(np.rad2deg(rms(np.linalg.norm(errors[:, :3], axis=1))))
    return scores


def distances_driven(true: NDArray[np.float64]) -> Values:
    """(N,) distance driven up to each of (N, 4, 4) poses, m."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)))


def relative_poses(poses: NDArray[np.float64], first: NDArray[np.int64], last: NDArray[np.int64]) -> Poses:
    """(M, 4, 4) poses ``last`` relative to poses ``first``, which are (M,) indices into (N, 4, 4) ``poses``."""
    return np.linalg.inv(poses[first]) @ poses[last]


def errors_of(true: NDArray[np.float64], estimated: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 6) rotation vectors, rad, and translations, m, of true (N, 4, 4) poses relative to estimated poses."""
    E = np.linalg.inv(estimated) @ true
    return np.hstack([Rotation.from_matrix(E[:, :3, :3]).as_rotvec(), E[:, :3, 3]])


def rms(values: NDArray[np.floating]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def nees(errors: NDArray[np.float64], covariances: NDArray[np.float64]) -> float:
    """Normalised estimation error squared of (N, 6) errors with (N, 6, 6) covariances, per dimension.

    The value is 1 if the errors match the covariances; a larger value means that the covariances are too small
    (Bar-Shalom, Li and Kirubarajan 2001, 5.4.2).
    """
    return float(each_nees(errors, covariances).mean())


def each_nees(errors: NDArray[np.float64], covariances: NDArray[np.float64]) -> Values:
    """(N,) normalised estimation error squared of each of (N, 6) errors, per dimension; see :func:`nees`."""
    return np.asarray(np.einsum("ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]) / 6)


def moved_along(online: NDArray[np.float64], keyframes: Sequence[int], poses: Poses) -> Poses:
    """(N, 4, 4) online poses, each moved along with the correction of the latest keyframe before it.

    Args:
        online: (N, 4, 4) poses as estimated during the drive.
        keyframes: (K,) indices of the poses that are keyframes.
        poses: (K, 4, 4) corrected poses of the keyframes.
    """
    indices = np.array(keyframes)
    last = np.searchsorted(indices, np.arange(len(online)), side="right") - 1
    return np.asarray((poses @ np.linalg.inv(online[indices]))[last] @ online)


def within(sigmas: float, errors: NDArray[np.float64], covariances: NDArray[np.float64]) -> float:
    """Fraction of the components of (N, 6) errors within ``sigmas`` standard deviations, by (N, 6, 6) covariances."""
    return float((np.abs(errors) <= sigmas * np.sqrt(np.einsum("nii->ni", covariances))).mean())


def evo_ate(true: Path, estimated: Path) -> float:
    """Evo's root mean square position error, m, between two TUM trajectory files, without alignment."""
    from evo.core.metrics import APE, PoseRelation, StatisticsType
    from evo.tools.file_interface import read_tum_trajectory_file

    ape = APE(PoseRelation.translation_part)
    ape.process_data((read_tum_trajectory_file(true), read_tum_trajectory_file(estimated)))
    return float(ape.get_statistic(StatisticsType.rmse))
