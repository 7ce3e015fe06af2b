"""Projective updates by depth images, compared with exact ray traversal."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pipeline.frame import Intrinsics
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import FREE, UNKNOWN, MetricMap
from pipeline.transforms import from_rotation
from tests.pipeline.metric_map.box_room import CAMERA, depth_image, looking, returns, tour

UP = np.array([0, 0, 0.15])
EXACT = {"margin": 0.0, "max_range": 10.0}  # as numbers of the kind that the map has: others would be compiled anew


def window(*maps):
    """The log-odds of maps over all that is known to any of them."""
    corners = np.array([corner for metric_map in maps for corner in metric_map.bounds()])
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    return [metric_map.log_odds(lower, upper) for metric_map in maps]


def by_both(depths, poses, config=EXACT, camera=CAMERA):
    """The log-odds by projection and by rays."""
    projected, traced = MetricMap(MetricMapConfig(**config)), MetricMap(MetricMapConfig(**config))
    for depth, T in zip(depths, poses, strict=True):
        projected.integrate(depth, camera, T)
        traced.integrate_points(returns(depth, T, camera), T[:3, 3])
    return window(projected, traced)


def test_after_a_tour_projection_and_rays_agree_in_98_percent_of_the_voxels():
    poses = tour(30)
    projected, traced = by_both([depth_image(T) for T in poses], poses)
    known = (projected != 0) | (traced != 0)
    assert (np.sign(projected) == np.sign(traced))[known].mean() >= 0.98


def test_single_frames_find_the_very_same_occupied_voxels_and_96_percent_of_all():
    same = known = 0
    for T in tour(12):
        projected, traced = by_both([depth_image(T)], [T])
        np.testing.assert_array_equal(projected > 0, traced > 0)
        seen = (projected != 0) | (traced != 0)
        same += (np.sign(projected) == np.sign(traced))[seen].sum()
        known += seen.sum()
    assert same / known >= 0.96


# Depths in patches, so that there are surfaces, steps, and holes without a return.
patches = hnp.arrays(np.float32, (3, 4), elements=st.sampled_from([0.0, 0.45, 0.9, 1.3, 2.2, 3.4]))
rotations = st.tuples(*[st.floats(-3.1, 3.1)] * 3).map(lambda angles: Rotation.from_euler("xyz", angles).as_matrix())
poses = st.builds(from_rotation, rotations, st.tuples(*[st.floats(-3, 3)] * 3))


@settings(max_examples=60, deadline=None)
@given(patches, poses)
def test_whatever_the_scene_hits_are_those_of_the_rays_and_free_voxels_lie_on_or_beside_them(patches, T):
    depth = np.kron(patches, np.ones((40, 40), np.float32))
    if not depth.any():
        return
    projected, traced = by_both([depth], [T])
    np.testing.assert_array_equal(projected > 0, traced > 0)
    beside = ndimage.binary_dilation(traced != 0, np.ones((3, 3, 3)))
    assert not ((projected < 0) & ~beside).any()


@settings(max_examples=30, deadline=None)
@given(poses, st.floats(0.8, 3.0))
def test_a_wall_of_one_depth_leaves_out_hardly_a_voxel_before_it(T, distance):
    depth = np.full((120, 160), distance, np.float32)
    projected, traced = by_both([depth], [T])
    missed = (traced < 0) & (projected == 0)
    assert missed.sum() <= 0.03 * (traced < 0).sum() + 2


def test_the_narrow_ends_of_the_field_of_view_are_free():
    depth, T = np.full((120, 160), 3.0, np.float32), looking(0.05, 0.05, 0.55, 0.3, 0.2)
    metric_map = MetricMap(MetricMapConfig(**EXACT))
    metric_map.integrate(depth, CAMERA, T)
    middle_and_corners = CAMERA.rays[[60, 0, 0, -1, -1], [80, 0, -1, 0, -1]].astype(np.float64)
    reach = np.linspace(0, [0.5, 2.9, 2.9, 2.9, 2.9], 100)
    along = (reach[..., None] * middle_and_corners).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    assert (metric_map.p_free_at(along) == FREE).all()


def test_what_lies_right_behind_a_crest_stays_unknown():
    # A level camera before a wall 2 m away; something 0.8 m away hides all below its line of sight over row 78.
    depth = np.full((120, 160), 2.0, np.float32)
    depth[78:] = 0.8
    T = looking(0, 0, 0.5, 0, 0)
    metric_map, rays = MetricMap(MetricMapConfig(**EXACT)), MetricMap(MetricMapConfig(**EXACT))
    metric_map.integrate(depth, CAMERA, T)
    rays.integrate_points(returns(depth, T), T[:3, 3])
    x = np.arange(1.0, 1.8, 0.05)
    crest = np.column_stack([x, np.zeros_like(x), 0.5 - x * 18 / CAMERA.fy])
    assert (metric_map.p_free_at(crest) == UNKNOWN).mean() > 0.7
    assert (metric_map.p_free_at(crest + UP) == FREE).all()
    assert (metric_map.p_free_at(crest - UP) == UNKNOWN).all()
    assert (rays.p_free_at(crest + UP / 30) == FREE).all()


def test_beside_a_post_nothing_is_left_out():
    depth = np.full((120, 160), 2.0, np.float32)
    depth[:, 62:98] = 0.8
    projected, traced = by_both([depth], [looking(0, 0, 0.5, 0, 0)])
    assert ((projected == 0) & (traced < 0)).sum() <= 0.02 * (traced < 0).sum()


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (7, 9), (30, 100)])
def test_images_of_any_size_are_mapped(shape):
    height, width = shape
    camera = Intrinsics(width, height, 0.9 * max(shape), 0.9 * max(shape), width / 2, height / 2)
    metric_map = MetricMap(MetricMapConfig(**EXACT))
    metric_map.integrate(np.full(shape, 1.0, np.float32), camera, looking(0, 0, 0.5, 0, 0))
    assert metric_map.p_free_at([(1, 0, 0.5), (0.5, 0, 0.5)]).tolist() == [0, 1]


@given(st.tuples(*[st.integers(-1000, 1000)] * 3))
@settings(max_examples=20, deadline=None)
def test_the_place_in_the_environment_makes_no_difference(steps):
    T = looking(0.3, -0.2, 0.5, 0.7, 0.2)
    depth = depth_image(T)
    moved = T.copy()
    moved[:3, 3] += 0.125 * np.array(steps)
    here, there = MetricMap(MetricMapConfig(voxel_size=0.125)), MetricMap(MetricMapConfig(voxel_size=0.125))
    here.integrate(depth, CAMERA, T)
    there.integrate(depth, CAMERA, moved)
    lower, upper = here.bounds()
    np.testing.assert_array_equal(
        here.log_odds(lower, upper), there.log_odds(lower + np.array(steps), upper + np.array(steps))
    )
