from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.transforms import from_yaw

INTRINSICS = Intrinsics(width=4, height=2, fx=2.0, fy=2.0, cx=2.0, cy=1.0)


def frame(depth) -> Frame:
    depth = np.asarray(depth, np.float32)
    return Frame(0.0, np.zeros((2, 4, 3), np.uint8), depth, INTRINSICS, np.eye(4), np.eye(4))


def test_rays_go_through_pixel_centres():
    np.testing.assert_allclose(INTRINSICS.rays[0, 0], (-0.75, -0.25, 1))
    np.testing.assert_allclose(INTRINSICS.rays[1, 3], (0.75, 0.25, 1))


def test_cameras_that_are_alike_share_their_rays():
    assert replace(INTRINSICS).rays is INTRINSICS.rays
    assert replace(INTRINSICS, cx=1.0).rays[0, 0, 0] == -0.25


def test_points_fall_in_the_pixels_whose_rays_they_lie_on():
    rays = INTRINSICS.rays.reshape(-1, 3)
    pixels, inside = INTRINSICS.project(rays * np.linspace(0.5, 4, len(rays))[:, None])
    assert pixels.tolist() == [list(pixel) for pixel in np.ndindex(2, 4)]
    assert inside.all()


def test_points_beside_the_image_or_behind_the_camera_are_not_inside():
    points = np.array([[0, 0, 1], [-1.1, 0, 1], [1.1, 0, 1], [0, -0.6, 1], [0, 0.6, 1], [0, 0, -1], [0, 0, 0]])
    assert INTRINSICS.project(points)[1].tolist() == [True] + 6 * [False]


def test_what_is_no_positive_finite_depth_is_no_return():
    step = frame([[0, -1, np.nan, np.inf], [1, 0, 0, 2]])
    assert step.returns.tolist() == [[False] * 4, [True, False, False, True]]
    np.testing.assert_allclose(step.points(np.eye(4)), [(-0.75, 0.25, 1), (1.5, 0.5, 2)])


def test_points_are_in_the_target_frame():
    step = frame([[0, 0, 0, 0], [1, 0, 0, 0]])
    np.testing.assert_allclose(step.points(from_yaw(10, 0, 0, 0)), [(9.25, 0.25, 1)])


@pytest.mark.parametrize("shape", [(1, 2), (4, 8), (4, 2), (2, 3), (8,)])
def test_an_image_of_another_size_than_its_intrinsics_is_refused(shape):
    with pytest.raises(InputError, match="4 × 2"):
        INTRINSICS.points(np.ones(shape, np.float32), np.eye(4))


def test_an_empty_image_has_no_points():
    assert frame(np.zeros((2, 4))).points(np.eye(4)).shape == (0, 3)
