"""RANSAC by Open3D: what it finds, and that it always finds the same."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from pipeline.geometry.planes import plane_inliers


def test_larger_of_two_planes_is_found_and_outliers_are_left_out() -> None:
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(0, 2, (300, 2)), rng.normal(0, 0.005, 300)]
    wall = np.c_[rng.normal(0, 0.005, 200), rng.uniform(0.1, 2, (200, 2))]
    inlier = plane_inliers(np.vstack([floor, wall]).astype(np.float32), 0.03, 100, seed=0)
    assert inlier[:300].all()
    assert not inlier[300:].any()


def digest() -> str:
    """Of what is found in many clouds."""
    found, rng = hashlib.sha256(), np.random.default_rng(0)
    for seed in range(100):
        n = rng.integers(30, 3000)
        points = np.c_[rng.uniform(0, 2, (n, 2)), rng.normal(0, 0.02, n)].astype(np.float32)
        points[: n // 3] = points[: n // 3, [2, 0, 1]]
        found.update(plane_inliers(points, 0.04, 100, seed).tobytes())
    return found.hexdigest()


def test_number_and_timing_of_threads_do_not_matter() -> None:
    program = "from tests.pipeline.geometry.test_plane_inliers import digest; print(digest())"
    environment = {**os.environ, "OMP_NUM_THREADS": "7"}
    command, root = [sys.executable, "-c", program], Path(__file__).parents[3]
    assert subprocess.check_output(command, env=environment, cwd=root, text=True).strip() == digest()
