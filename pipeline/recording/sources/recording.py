"""A recording: frames, and the known poses at which they were taken."""

from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.transforms import from_rotation, inverse

NEAR = 0.02  # s from a pose within which it is still valid
LONGEST_GAP = 0.5  # s between two poses, the longest time over which they are interpolated


class Calibration(NamedTuple):
    """Intrinsics of a camera as calibrations give them: pixel centres are at integers."""

    fx: float
    fy: float
    cx: float
    cy: float


class CameraPose(NamedTuple):
    """Pose of a camera on a robot: m and degrees in ``base_link``; at angles of 0 it looks forward and is level."""

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float

    @property
    def T_base_camera(self) -> NDArray[np.float64]:
        """4×4 pose of ``camera_optical``; by REP 103 the pitch of a camera that looks down is positive."""
        R = Rotation.from_euler("ZYX", [self.yaw, self.pitch, self.roll], degrees=True).as_matrix()
        return from_rotation(R @ LINK_OPTICAL, [self.x, self.y, self.z])


LINK_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation of ``camera_optical`` in a body that looks along its x axis (REP 103)."""


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
        return self.poses[k] if abs(self.times[k] - time) <= NEAR else None

    def of_base(self, T_base_camera: NDArray[np.float64]) -> "Trajectory":
        """The trajectory of ``base_link``, on which the camera has a 4×4 pose."""
        return Trajectory(self.times, self.poses @ inverse(T_base_camera)) if self.of_camera else self


@dataclass(eq=False)
class Recording:
    """Frames of an RGB-D camera, and other data recorded with them.

    Attributes:
        path: of its file or folder.
        frames: makes an iterator over the frames in the order of time. Their ``T_odom_base`` is the identity, and so
            is ``T_base_camera`` if it is unknown. The iterator raises InputError where the recording is broken; the
            frames before are good.
        has_camera_pose: whether the frames have the camera's pose on the robot.
        odometry: ``T_odom_base``, if it was recorded.
        truth: true poses for comparison, in any frame.
        up: (3,) the vertical in ``base_link`` at the beginning, by an accelerometer.
        keyframes: the times of the frames of which the robot made keyframes, and whether it labelled them.
        steps: the times of those keyframes at which the robot stood, corrected its maps and planned.
        left_out: number of items that could not be used, by reason.
    """

    path: Path
    frames: Callable[[], Iterator[Frame]]
    has_camera_pose: bool = False
    odometry: Trajectory | None = None
    truth: Trajectory | None = None
    up: NDArray[np.float64] | None = None
    keyframes: Mapping[float, bool] | None = None
    steps: Set[float] = frozenset()
    left_out: dict[str, int] = field(default_factory=dict)

    def leave_out(self, reason: str) -> None:
        """Count an item that cannot be used."""
        self.left_out[reason] = self.left_out.get(reason, 0) + 1

    def check_clocks(self, first: float, last: float) -> None:
        """Raise InputError if the times of known poses do not overlap those of the images, from first to last, s."""
        for name, known in (("odometry", self.odometry), ("true poses", self.truth)):
            if known is not None and (known.times[0] > last or known.times[-1] < first):
                spans = (
                    f"{first:.2f} to {last:.2f} s, the {name} from {known.times[0]:.2f} to {known.times[-1]:.2f} s"
                )
                raise InputError(f"{self.path}: its clocks differ: the images are from {spans}")


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
