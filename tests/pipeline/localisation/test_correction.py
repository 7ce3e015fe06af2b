import numpy as np

from pipeline.localisation.correction import Correction, moved_by
from pipeline.transforms import from_yaw

BEFORE = np.array([from_yaw(0, 0, 0, 0), from_yaw(4, 0, 0, 1.0)])
AFTER = np.array([from_yaw(0, 0, 0, 0), from_yaw(4, 1, 0.5, 1.0 + np.pi / 2)])


def test_places_go_along_with_the_keyframe_that_stood_nearest():
    correction = Correction(BEFORE, AFTER)
    places = np.array([(1.0, 0.5, 0.2), (4.0, 0.0, 0.0), (5.0, 0.0, 0.1)])
    np.testing.assert_allclose(correction.moved(places), [(1, 0.5, 0.2), (4, 1, 0.5), (4, 2, 0.6)], atol=1e-12)
    np.testing.assert_allclose(correction.moved(places[:, :2]), [(1, 0.5), (4, 1), (4, 2)], atol=1e-12)
    np.testing.assert_allclose(correction.motion_at(np.array([3.0, 3.0])) @ BEFORE[1], AFTER[1], atol=1e-12)


def test_it_tells_how_far_each_keyframe_moved_and_turned():
    correction = Correction(BEFORE, AFTER)
    np.testing.assert_allclose(correction.ways, [0, np.hypot(1, 0.5)])
    np.testing.assert_allclose(correction.turns, [0, np.pi / 2])


def test_poses_that_stay_move_nothing():
    places = np.random.default_rng(0).uniform(-5, 5, (20, 3))
    np.testing.assert_allclose(Correction(BEFORE, BEFORE).moved(places), places, atol=1e-12)


def test_no_places_stay_none():
    for size in (2, 3):
        assert Correction(BEFORE, AFTER).moved(np.zeros((0, size))).shape == (0, size)
        assert moved_by(AFTER[1], np.zeros((0, size))).shape == (0, size)
