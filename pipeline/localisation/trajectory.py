"""Trajectories: timed poses from odometry, from localisation, or from ground truth."""

from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pipeline.arrays import Pose, Poses, Values
from pipeline.errors import InputError
from pipeline.files import atomic_write, read_numbers
from pipeline.localisation.config import TrajectoryConfig
from pipeline.localisation.localisation import Localisation
from pipeline.transforms import FARTHEST, are_poses, from_rotation, inverse

MIN_SINCE_1970 = 1e8
"""Smallest plausible time since 1970, s (a date in 1973); the same time in ms, µs or ns exceeds all plausible times
in s."""


class Trajectory:
    """Poses of ``base_link`` or of the camera, with their times.

    Attributes:
        times: times in ascending order, s.
        poses: poses at these times.
        of_camera: whether the poses are the camera's instead of ``base_link``'s.
        left_out: number of lines of the file without a pose.
    """

    left_out = 0

    def __init__(self, times: Values, poses: Poses, of_camera: bool = False) -> None:
        """Sort the poses by their ``times``, s; of several poses with the same time, the first is kept."""
        self.times, first = np.unique(times, return_index=True)
        self.poses, self.of_camera = poses[first], of_camera

    def at(self, time: float, config: TrajectoryConfig) -> Pose | None:
        """Pose at a time, s: interpolated, or else the nearest one if it is still valid; None if neither exists."""
        after = int(np.searchsorted(self.times, time))
        if after < len(self.times) and self.times[after] == time:
            return self.poses[after]
        pair = slice(after - 1, after + 1)
        if 0 < after < len(self.times) and np.ptp(self.times[pair]) <= config.max_interpolation_gap:
            share = (time - self.times[after - 1]) / np.ptp(self.times[pair])
            R = Slerp([0.0, 1.0], Rotation.from_matrix(self.poses[pair, :3, :3]))(share).as_matrix()
            start, end = self.poses[pair, :3, 3]
            return from_rotation(R, start + share * (end - start))
        k = min((k for k in (after - 1, after) if 0 <= k < len(self.times)), key=lambda k: abs(self.times[k] - time))
        return self.poses[k] if abs(self.times[k] - time) <= config.max_time_offset else None

    def of_base(self, T_base_camera: Pose) -> "Trajectory":
        """The trajectory of ``base_link``, given the camera's pose ``T_base_camera`` on the robot."""
        if not self.of_camera:
            return self
        return Trajectory(self.times, self.poses @ inverse(T_base_camera))

    def moved(self, T: Pose) -> "Trajectory":
        """The same trajectory in another frame; ``T``: pose of the current frame in the other one."""
        return Trajectory(self.times, T @ self.poses, self.of_camera)


class OdometryPose(Protocol):
    """A pose from odometry with its time, as contained in frames and motions."""

    @property
    def time(self) -> float:
        """Time, s."""

    @property
    def T_odom_base(self) -> Pose:
        """Pose of ``base_link`` in ``odom``."""


Sample = TypeVar("Sample", bound=OdometryPose)


class EstimatedTrajectory(Generic[Sample]):
    """The robot's poses in ``map``, including those between keyframes."""

    def __init__(self, localisation: Localisation, odometry: Sequence[Sample]):
        """``odometry`` grows as the robot drives; keyframes already in ``localisation`` are from an earlier run."""
        self._localisation, self._odometry = localisation, odometry
        self._keyframes: list[Sample] = []
        self._loaded = localisation.poses.copy()

    def add(self, keyframe: Sample | None = None) -> None:
        """Add the newest keyframe, by default at the newest pose of the odometry."""
        self._keyframes.append(keyframe or self._odometry[-1])

    @property
    def begin(self) -> float:
        """Time of the first pose or keyframe of this run, s; there must be one."""
        return min(pose.time for pose in (*self._odometry[:1], *self._keyframes[:1]))

    def estimated(self) -> list[Pose]:
        """``T_map_base`` of each odometry pose, obtained by odometry from the last keyframe before it."""
        if not self._keyframes:
            return [pose.T_odom_base for pose in self._odometry]
        pairs = zip(self._localisation.poses[len(self._loaded) :], self._keyframes, strict=True)
        T_map_odom = [T @ inverse(keyframe.T_odom_base) for T, keyframe in pairs]
        times = [keyframe.time for keyframe in self._keyframes]
        return [T_map_odom[max(bisect_right(times, p.time) - 1, 0)] @ p.T_odom_base for p in self._odometry]

    def save(self, folder: Path) -> None:
        """Write trajectory_estimated.tum into a folder."""
        write_tum(folder / "trajectory_estimated.tum", [pose.time for pose in self._odometry], self.estimated())


def write_tum(path: Path, times: Sequence[float], poses: Sequence[Pose]) -> None:
    """Write poses and their times, s, in the TUM format: time, position, quaternion (x y z w).

    Raises:
        InputError: the file cannot be written.
    """
    lines = []
    for time, T in zip(times, poses, strict=True):
        numbers = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        lines.append(f"{time:.3f} " + " ".join(f"{n:.6f}" for n in numbers))
    with atomic_write(path) as partial:
        partial.write_text("\n".join(lines) + "\n")


def read_trajectory(path: Path, of_camera: bool) -> Trajectory:
    """Read a file in the TUM format: time (see :func:`in_seconds`), position in m, quaternion (x y z w).

    Lines with non-finite numbers or a zero quaternion are left out, because trackers write such lines while they are
    lost.

    Raises:
        InputError: the file cannot be read, a line does not have this format, or no line holds a pose.
    """
    rows = read_numbers(path, "time x y z qx qy qz qw", finite=False)
    good = rows[np.isfinite(rows).all(axis=1) & rows[:, 4:].any(axis=1)]
    if not len(good):
        raise InputError(f"{path}: not a trajectory: all lines have non-finite numbers or a zero quaternion")
    poses = np.tile(np.eye(4), (len(good), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_quat(good[:, 4:]).as_matrix(), good[:, 1:4]
    if not are_poses(poses):
        raise InputError(f"{path}: all positions must be within ±{FARTHEST:g} m")
    trajectory = Trajectory(in_seconds(good[:, 0]), poses, of_camera)
    trajectory.left_out = len(rows) - len(good)
    return trajectory


def in_seconds(times: Values) -> Values:
    """Convert times in s, or in ms, µs or ns since 1970, to s; the unit is inferred from their median.

    Args:
        times: all times of a file, (N,) or (N, 1), at least one.
    """
    return times / next((unit for unit in (1e9, 1e6, 1e3) if np.median(times) > MIN_SINCE_1970 * unit), 1.0)
