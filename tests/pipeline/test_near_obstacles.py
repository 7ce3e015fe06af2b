import numpy as np
import pytest

from pipeline.frame import Intrinsics
from pipeline.near_obstacles import NearObstaclesConfig, near_obstacles
from pipeline.transforms import from_rotation

CAMERA = Intrinsics(160, 120, 144.0, 144.0, 80.0, 60.0)
HALF_WIDTH = 80 / 144
"""Of the picture, m at a depth of 1 m."""
NEAR = NearObstaclesConfig()


def camera(pitch_deg: float) -> np.ndarray:
    """A camera 0.6 m above the origin that looks along x and so far down."""
    sin, cos = np.sin(np.deg2rad(pitch_deg)), np.cos(np.deg2rad(pitch_deg))
    return from_rotation([[0, -sin, cos], [-1, 0, 0], [0, -cos, -sin]], [0, 0, 0.6])


def suspected(depth: np.ndarray, pitch_deg: float = 12.0) -> np.ndarray:
    return near_obstacles(depth.astype(np.float32), CAMERA, camera(pitch_deg))


def test_a_picture_of_ground_raises_no_suspicion():
    assert suspected(np.full((120, 160), 2.0)).shape == (0, 2)


def test_a_picture_of_nothing_raises_it_right_before_the_camera_and_beside_the_picture():
    points = suspected(np.zeros((120, 160)))
    np.testing.assert_allclose(points[:, 0], NEAR.distance * np.cos(np.deg2rad(12)), atol=1e-5)
    reach = NEAR.distance * HALF_WIDTH + NEAR.beyond
    np.testing.assert_allclose([points[:, 1].min(), points[:, 1].max()], [-reach, reach], atol=NEAR.spacing)
    assert np.abs(np.diff(np.sort(points[:, 1]))).max() < 1.1 * NEAR.spacing


def test_only_blind_columns_raise_it():
    depth = np.full((120, 160), 2.0)
    depth[:, :80] = 0
    points = suspected(depth)
    assert points[:, 1].min() > -NEAR.spacing  # the left half of the picture is where y is positive
    assert points[:, 1].max() > NEAR.distance * HALF_WIDTH + NEAR.beyond - 2 * NEAR.spacing


def test_what_is_seen_above_a_blind_foreground_does_not_matter():
    depth = np.zeros((120, 160))
    depth[:40] = 3.0
    assert len(suspected(depth)) == len(suspected(np.zeros((120, 160))))


@pytest.mark.parametrize("pitch_deg", [-5.0, 0.0])
def test_a_camera_that_hardly_looks_down_tells_nothing(pitch_deg):
    assert not len(suspected(np.zeros((120, 160)), pitch_deg))
