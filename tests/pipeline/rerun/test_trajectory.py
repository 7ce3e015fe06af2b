"""The driven way, thinned, and how it follows corrected keyframes."""

import numpy as np
import pytest

from pipeline.localisation.localisation import LocalisedFrame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.rerun.trajectory import CorrectedTrajectory, DrawnTrajectory
from pipeline.transforms import from_yaw


def test_a_track_keeps_the_whole_distance_and_few_points():
    track = DrawnTrajectory(0.04)
    kept = [track.add(np.array([0.01 * k, 0, 0])) for k in range(101)]
    assert track.distance == pytest.approx(1.0)
    gaps = np.linalg.norm(np.diff(track.positions, axis=0), axis=1)
    assert sum(kept) == len(track.positions) >= 17
    assert gaps.min() >= 0.04 - 1e-9


def pose(x=0.0, y=0.0, yaw=0.0):
    """4×4 of a level body."""
    return from_yaw(x, y, 0.0, yaw)


def test_each_point_follows_the_keyframe_before_it():
    localisation, track = OdometryLocalisation(), CorrectedTrajectory(0.04)
    for x in (0.0, 1.0):
        localisation.add(LocalisedFrame(None, pose(x)))
        for way in (0.0, 0.5):
            track.add(pose(x + way), localisation)
    np.testing.assert_allclose(track.positions(localisation.poses)[:, 0], [0, 0.5, 1, 1.5])
    turned = np.array([pose(), pose(1, 0.1, np.pi / 2)])
    places = track.positions(turned)
    np.testing.assert_allclose(places, [[0, 0, 0], [0.5, 0, 0], [1, 0.1, 0], [1, 0.6, 0]], atol=1e-12)
    assert track.distance == pytest.approx(1.5)


def test_the_odometrys_origin_counts_as_the_newest_keyframe_has_it():
    localisation, track = OdometryLocalisation(), CorrectedTrajectory(0.04)
    track.add(np.eye(4), None)
    localisation.add(LocalisedFrame(None, pose(0, 2)))
    localisation.T_map_odom = pose(0, 2, np.pi / 2)
    track.add(pose(1), localisation)
    np.testing.assert_allclose(track.positions(localisation.poses), [[0, 3, 0]], atol=1e-12)
    assert track.distance == pytest.approx(1.0)
