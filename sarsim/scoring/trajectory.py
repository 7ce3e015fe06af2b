"""Errors of the estimated trajectory, and the distance and tilt of the true one."""

from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.files import whole_file
from pipeline.localisation.localisation import Localisation, Loop
from pipeline.transforms import inverse, tilt_of, wrap_angle, yaw_of
from sarsim.robots.pose import Pose

TIPPED = np.deg2rad(45)
LIFT = 0.15  # m from one pose to the next; in a larger step the robot was carried


FALSE_LOOP = 0.2, np.deg2rad(5)  # m and rad by which the relative pose of a false loop is off


class TrajectoryScore:
    """Collects the keyframes, and compares the estimated trajectory with the true one."""

    def __init__(self, localisation: Localisation, trajectory: Sequence[Pose]):
        """``trajectory`` grows while the robot drives. Poses already in ``localisation`` are an earlier episode's."""
        self._localisation, self._trajectory = localisation, trajectory
        self._keyframes: list[Pose] = []
        self._loaded = localisation.poses.copy()

    def add(self, pose: Pose | None = None) -> None:
        """Add the pose of a new keyframe, by default the newest of the trajectory."""
        self._keyframes.append(pose or self._trajectory[-1])

    def estimated(self) -> list[NDArray[np.float64]]:
        """4×4 ``T_map_base`` at every pose of the trajectory: by odometry from the keyframe before it."""
        if not self._keyframes:
            return [pose.T_odom_base for pose in self._trajectory]
        pairs = zip(self._localisation.poses[len(self._loaded) :], self._keyframes, strict=True)
        T_map_odom = [T @ inverse(keyframe.T_odom_base) for T, keyframe in pairs]
        times = [keyframe.time for keyframe in self._keyframes]
        return [T_map_odom[max(bisect_right(times, p.time) - 1, 0)] @ p.T_odom_base for p in self._trajectory]

    def save(self, folder: Path, with_truth: bool) -> None:
        """Write trajectory_estimated.tum and, where it is known, trajectory_true.tum into a folder."""
        times = [pose.time for pose in self._trajectory]
        write_tum(folder / "trajectory_estimated.tum", times, self.estimated())
        if with_truth:
            write_tum(folder / "trajectory_true.tum", times, [pose.T_world_base for pose in self._trajectory])

    def report(self) -> dict[str, float]:
        """Errors without alignment, as ``map`` is the world's frame at the start; drift is the error at the end."""
        true = np.array([pose.T_world_base for pose in self._trajectory])
        estimated = np.array(self.estimated())
        error = np.linalg.norm(true[:, :3, 3] - estimated[:, :3, 3], axis=1)
        heading = [wrap_angle(yaw_of(a) - yaw_of(b)) for a, b in zip(true, estimated, strict=True)]
        distance = driven(self._trajectory)
        # The poses of an earlier episode are those of its map, because its true ones are unknown.
        loops, poses = self._localisation.loops, [*self._loaded, *(pose.T_world_base for pose in self._keyframes)]
        return {
            "ate_rmse_m": float(np.sqrt(np.mean(error**2))),
            "heading_rmse_deg": float(np.degrees(np.sqrt(np.mean(np.square(heading))))),
            "drift_percent": float(100 * error[-1] / distance) if distance > 0 else 0.0,
            "keyframes": len(self._keyframes),
            "loops": len(loops),
            "false_loops": sum(is_false(loop, poses[loop.first], poses[loop.second]) for loop in loops),
        }


def is_false(loop: Loop, T_world_first: NDArray[np.float64], T_world_second: NDArray[np.float64]) -> bool:
    """Whether a loop between keyframes at these true poses, 4×4, is off by more than ``FALSE_LOOP``."""
    off = np.linalg.solve(np.linalg.solve(T_world_first, T_world_second), loop.T_first_second)
    turn = Rotation.from_matrix(off[:3, :3]).magnitude()
    return bool(np.linalg.norm(off[:3, 3]) > FALSE_LOOP[0] or turn > FALSE_LOOP[1])


def driven(trajectory: Sequence[Pose]) -> float:
    """Metres along the true trajectory.

    Left out are steps below half a millimetre, which springs cause, not wheels, and steps beyond ``LIFT``.
    """
    steps = np.linalg.norm(np.diff([p.T_world_base[:2, 3] for p in trajectory], axis=0), axis=1)
    return float(steps[(steps > 5e-4) & (steps < LIFT)].sum())


def motion_figures(trajectory: Sequence[Pose]) -> dict[str, float]:
    """The figures of a true trajectory for report.json."""
    roll, pitch = greatest_tilt(trajectory)
    return {
        "tipped": times_tipped(trajectory),
        "distance_m": driven(trajectory),
        "max_roll_deg": float(np.degrees(roll)),
        "max_pitch_deg": float(np.degrees(pitch)),
    }


def greatest_tilt(trajectory: Sequence[Pose]) -> tuple[float, float]:
    """Greatest roll and pitch of the true trajectory, rad."""
    tilts = np.abs([tilt_of(p.T_world_base) for p in trajectory])
    return float(tilts[:, 0].max()), float(tilts[:, 1].max())


def times_tipped(trajectory: Sequence[Pose]) -> int:
    """How often the robot fell over."""
    tipped = np.array([p.T_world_base[2, 2] < np.cos(TIPPED) for p in trajectory])
    return int(np.count_nonzero(np.diff(tipped.astype(int), prepend=0) > 0))


def write_tum(path: Path, times: Sequence[float], poses: Sequence[NDArray[np.float64]]) -> None:
    """Write 4×4 poses at times in s in the TUM format: time, position, quaternion (x y z w)."""
    lines = []
    for time, T in zip(times, poses, strict=True):
        numbers = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        lines.append(f"{time:.3f} " + " ".join(f"{n:.6f}" for n in numbers))
    with whole_file(path) as partial:
        partial.write_text("\n".join(lines) + "\n")
