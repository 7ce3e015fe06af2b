"""Poses at times: what an odometry measured, or what is true."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from pipeline.errors import InputError
from pipeline.transforms import from_rotation, inverse

STILL_VALID = 0.02  # s from a pose within which it is still valid
LONGEST_GAP = 0.5  # s between two poses, the longest time over which they are interpolated


class Trajectory:
    """Poses at times.

    Attributes:
        times: (N,) s, rising.
        poses: (N, 4, 4).
        of_camera: whether they are the camera's; else they are those of ``base_link``.
    """

    def __init__(self, times: NDArray[np.float64], poses: NDArray[np.float64], of_camera: bool = False):
        """Sort (N, 4, 4) ``poses`` by their (N,) ``times``, s; of several poses at one time the first counts."""
        self.times, first = np.unique(times, return_index=True)
        self.poses, self.of_camera = poses[first], of_camera

    def at(self, time: float) -> NDArray[np.float64] | None:
        """4×4 pose at a time in s, interpolated over at most ``LONGEST_GAP``; None if it is not known."""
        after = int(np.searchsorted(self.times, time))
        if after < len(self.times) and self.times[after] == time:
            return self.poses[after]
        pair = slice(after - 1, after + 1)
        if 0 < after < len(self.times) and np.ptp(self.times[pair]) <= LONGEST_GAP:
            share = (time - self.times[after - 1]) / np.ptp(self.times[pair])
            R = Slerp([0.0, 1.0], Rotation.from_matrix(self.poses[pair, :3, :3]))(share).as_matrix()
            start, end = self.poses[pair, :3, 3]
            return from_rotation(R, start + share * (end - start))
        k = min((k for k in (after - 1, after) if 0 <= k < len(self.times)), key=lambda k: abs(self.times[k] - time))
        return self.poses[k] if abs(self.times[k] - time) <= STILL_VALID else None

    def of_base(self, T_base_camera: NDArray[np.float64]) -> "Trajectory":
        """The trajectory of ``base_link``, on which the camera has a 4×4 pose."""
        return Trajectory(self.times, self.poses @ inverse(T_base_camera)) if self.of_camera else self


def read_trajectory(path: Path, of_camera: bool) -> Trajectory:
    """Poses from a file in the TUM format: time in s, position in m, quaternion (x y z w).

    Raises:
        InputError: the file is missing, or a line is not of this format.
    """
    try:
        rows = np.loadtxt(path, ndmin=2, comments="#", dtype=np.float64)
        if rows.shape[1:] != (8,) or not np.isfinite(rows).all() or not len(rows):
            raise ValueError("lines must be time x y z qx qy qz qw")
        R = Rotation.from_quat(rows[:, 4:]).as_matrix()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(f"{path}: no trajectory: {' '.join(str(error).split())}") from error
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = R, rows[:, 1:4]
    return Trajectory(rows[:, 0], poses, of_camera)
