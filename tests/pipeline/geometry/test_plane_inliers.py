"""RANSAC: what it finds."""

import numpy as np

from pipeline.geometry.planes import plane_inliers


def test_larger_of_two_planes_is_found_and_outliers_are_left_out() -> None:
    rng = np.random.default_rng(0)
    floor = np.c_[rng.uniform(0, 2, (300, 2)), rng.normal(0, 0.005, 300)]
    wall = np.c_[rng.normal(0, 0.005, 200), rng.uniform(0.1, 2, (200, 2))]
    inlier = plane_inliers(np.vstack([floor, wall]).astype(np.float32), 0.03, 100, seed=0)
    assert inlier[:300].all()
    assert not inlier[300:].any()
