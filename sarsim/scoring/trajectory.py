"""Where the robot was, where it believed to be, and how far it leaned."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.files import whole_file
from pipeline.transforms import tilt_of
from sarsim.robots.pose import Pose

TIPPED = np.deg2rad(45)
LIFT = 0.15
"""m from one pose to the next."""


def score_localisation(trajectory: Sequence[Pose]) -> dict[str, float]:
    """Absolute trajectory error (both frames coincide, so nothing is aligned) and the drift at the end."""
    true = np.array([p.T_world_base[:3, 3] for p in trajectory])
    believed = np.array([p.T_odom_base[:3, 3] for p in trajectory])
    error = np.linalg.norm(true - believed, axis=1)
    distance = driven(trajectory)
    return {
        "ate_rmse_m": float(np.sqrt(np.mean(error**2))),
        "drift_percent": float(100 * error[-1] / distance) if distance > 0 else 0.0,
    }


def driven(trajectory: Sequence[Pose]) -> float:
    """Metres along the true trajectory.

    Steps below half a millimetre are the springs', not the wheels', and one beyond ``LIFT`` is the work of a hand.
    """
    steps = np.linalg.norm(np.diff([p.T_world_base[:2, 3] for p in trajectory], axis=0), axis=1)
    return float(steps[(steps > 5e-4) & (steps < LIFT)].sum())


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
