"""Errors of the estimated trajectory, and the distance and tilt of the true one."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Values
from pipeline.files import run_all
from pipeline.localisation.localisation import Loop
from pipeline.localisation.trajectory import EstimatedTrajectory, write_tum
from pipeline.transforms import roll_pitch_of, wrap_angle, yaw_of
from sarsim.robots.pose import TrajectorySample

TIPPING_TILT = np.deg2rad(45)  # rad; a body that leans more has fallen over
MIN_CARRIED_STEP = 0.15  # m per control period; a step of this length or more means that the robot was carried
MAX_STILL_STEP = 5e-4  # m per control period; steps up to this length come from springs, not from wheels


MAX_LOOP_ERROR = 0.2, np.deg2rad(5)  # A loop is false if its relative pose is off by more than this, m or rad


class TrajectoryScore(EstimatedTrajectory[TrajectorySample]):
    """The estimated trajectory, and its errors against the true one.

    Attributes:
        has_truth: whether the true poses are known; if not, the errors are unknown.
        is_recorded: whether the poses come from a recording, at any frequency, rather than one per control period.
    """

    has_truth, is_recorded = True, False

    def save(self, folder: Path) -> None:
        """Write trajectory_estimated.tum and, if the truth is known, trajectory_true.tum into a folder."""
        if not self.has_truth:
            super().save(folder)
            return
        write_true = partial(write_true_tum, folder / "trajectory_true.tum", self._odometry)
        run_all(lambda: super(TrajectoryScore, self).save(folder), write_true)

    def report(self) -> dict[str, float]:
        """Errors without alignment, because ``map`` and the world frame coincide at the start.

        Drift is the final position error relative to the distance driven. Where the true pose is unknown, nothing is
        compared.
        """
        true = np.array([pose.T_world_base for pose in self._odometry])
        known = np.isfinite(true).all(axis=(1, 2))
        true, estimated = true[known], np.array(self.estimated())[known]
        error = np.linalg.norm(true[:, :3, 3] - estimated[:, :3, 3], axis=1)
        heading = [wrap_angle(yaw_of(a) - yaw_of(b)) for a, b in zip(true, estimated, strict=True)]
        # For a recording, steps of any length are included.
        steps = np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)
        distance = float(steps.sum()) if self.is_recorded else distance_driven(self._odometry)
        # The true poses of an earlier episode's keyframes are unknown; the poses in its map are used instead.
        loops, poses = self._localisation.loops, [*self._loaded, *(pose.T_world_base for pose in self._keyframes)]
        pairs = [(loop, poses[loop.first], poses[loop.second]) for loop in loops]
        return {
            "ate_rmse_m": float(np.sqrt(np.mean(error**2))),
            "heading_rmse_deg": float(np.degrees(np.sqrt(np.mean(np.square(heading))))),
            "drift_percent": float(100 * error[-1] / distance) if distance > 0 else 0.0,
            "keyframes": len(self._keyframes),
            "loops": len(loops),
            "false_loops": sum(is_false(*pair) for pair in pairs if np.isfinite(pair[1:]).all()),
        }


def is_false(loop: Loop, T_world_first: NDArray[np.float64], T_world_second: NDArray[np.float64]) -> bool:
    """Whether the error of a loop between keyframes at these true 4×4 poses exceeds ``MAX_LOOP_ERROR``."""
    off = np.linalg.solve(np.linalg.solve(T_world_first, T_world_second), loop.T_first_second)
    turn = Rotation.from_matrix(off[:3, :3]).magnitude()
    return bool(np.linalg.norm(off[:3, 3]) > MAX_LOOP_ERROR[0] or turn > MAX_LOOP_ERROR[1])


def distance_driven(trajectory: Sequence[TrajectorySample]) -> float:
    """Distance in m that a simulated robot drove along its true trajectory."""
    return float(distances_driven(trajectory)[-1])


def distances_driven(trajectory: Sequence[TrajectorySample]) -> Values:
    """(N,) m, distance that a simulated robot had driven at each of its true poses, one per control period.

    Steps of at most ``MAX_STILL_STEP`` and of at least ``MIN_CARRIED_STEP`` are left out.
    """
    steps = np.linalg.norm(np.diff([p.T_world_base[:2, 3] for p in trajectory], axis=0), axis=1)
    is_driven = (steps > MAX_STILL_STEP) & (steps < MIN_CARRIED_STEP)
    return np.concatenate([[0.0], np.cumsum(np.where(is_driven, steps, 0))])


def motion_figures(trajectory: Sequence[TrajectorySample]) -> dict[str, float]:
    """Number of times a robot fell over, distance driven, and maximum roll and pitch, for report.json."""
    tipped = np.array([is_tipped(pose.T_world_base) for pose in trajectory])
    roll, pitch = np.abs([roll_pitch_of(pose.T_world_base) for pose in trajectory]).max(axis=0)
    return {
        "tipped": int(np.count_nonzero(np.diff(tipped.astype(int), prepend=0) > 0)),
        "distance_m": distance_driven(trajectory),
        "max_roll_deg": float(np.degrees(roll)),
        "max_pitch_deg": float(np.degrees(pitch)),
    }


def is_tipped(T: NDArray[np.float64]) -> bool:
    """Whether a body with a 4×4 pose or a 3×3 rotation has fallen over, i.e. leans by more than ``TIPPING_TILT``."""
    return bool(T[2, 2] < np.cos(TIPPING_TILT))


def write_true_tum(path: Path, trajectory: Sequence[TrajectorySample]) -> None:
    """Write the known true poses of a trajectory in the TUM format; InputError if the file cannot be written."""
    known = [pose for pose in trajectory if np.isfinite(pose.T_world_base).all()]
    write_tum(path, [pose.time for pose in known], [pose.T_world_base for pose in known])
