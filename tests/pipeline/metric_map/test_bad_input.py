"""Invalid depths, poses and cameras are ignored, or refused before anything changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline import grid_map
from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from tests.pipeline.metric_map.box_room import CAMERA, depth_image, looking, tour

T = looking(-1.4, -0.9, 0.5, 0.6, 0.2)
SCENE = depth_image(T)
NO_RETURN = [0.0, -0.0, -1.0, -np.inf, np.inf, np.nan, -1e30]


def mapped(depth=SCENE, pose=T, camera=CAMERA, **settings):
    metric_map = MetricMap(MetricMapConfig(**settings))
    metric_map.integrate(depth, camera, pose)
    return metric_map


def content(metric_map):
    lower, upper = metric_map.bounds()
    return lower.tolist(), metric_map.log_odds(lower, upper)


def assert_same(first, second):
    assert content(first)[0] == content(second)[0]
    np.testing.assert_array_equal(content(first)[1], content(second)[1])


@settings(max_examples=25)
@given(hnp.arrays(np.bool_, SCENE.shape), st.sampled_from(NO_RETURN))
def test_whatever_stands_for_no_return_has_the_effect_of_zero(holes, nothing):
    assert_same(mapped(np.where(holes, np.float32(nothing), SCENE)), mapped(np.where(holes, np.float32(0), SCENE)))


@settings(max_examples=25)
@given(hnp.arrays(np.float32, SCENE.shape, elements=st.floats(width=32), fill=st.sampled_from(NO_RETURN)))
def test_any_floats_at_all_mark_nothing_out_of_the_view(depth):
    metric_map = mapped(depth)
    inside = np.isfinite(depth) & (depth > 0) & (depth <= metric_map.max_range)
    assert (len(metric_map.occupied_centres()) > 0) == inside.any()
    camera_axes = (metric_map.free_centres() - T[:3, 3]) @ T[:3, :3]
    assert (camera_axes[:, 2] < metric_map.max_range + 0.1).all()
    assert (camera_axes[:, 2] > -0.1).all()


def test_empty_frames_change_nothing():
    metric_map = mapped()
    before = content(metric_map)
    for nothing in NO_RETURN:
        metric_map.integrate(np.full_like(SCENE, nothing), CAMERA, T)
    assert content(metric_map)[0] == before[0]
    np.testing.assert_array_equal(content(metric_map)[1], before[1])


@given(hnp.arrays(np.float64, (4, 4), elements=st.floats(-2, 2)))
def test_a_pose_that_is_not_rigid_is_refused_and_changes_nothing(pose):
    metric_map = mapped()
    before = content(metric_map)
    with pytest.raises(InputError, match="pose"):
        metric_map.integrate(SCENE, CAMERA, pose)
    np.testing.assert_array_equal(content(metric_map)[1], before[1])


def pose_with(place, value):
    pose = T.copy()
    pose[place] = value
    return pose


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        *(({"pose": pose_with((0, 0), value)}, "pose") for value in (np.nan, np.inf, -np.inf, 1e6)),
        *(({"pose": pose_with((2, 3), value)}, "pose") for value in (np.nan, np.inf, -np.inf, 1e6)),
        *(({"pose": pose}, "pose") for pose in (np.eye(3), np.diag([1.0, 1, -1, 1]), np.diag([2.0, 2, 2, 1]))),
        ({"camera": Intrinsics(159, 120, 144, 144, 80, 60)}, "does not fit"),
        ({"camera": Intrinsics(120, 160, 144, 144, 80, 60)}, "does not fit"),
        ({"camera": Intrinsics(160, 120, 0, 144, 80, 60)}, "focal"),
        ({"camera": Intrinsics(160, 120, 144, -144, 80, 60)}, "focal"),
        ({"camera": Intrinsics(160, 120, np.nan, 144, 80, 60)}, "focal"),
        ({"camera": Intrinsics(160, 120, 1e-300, 144, 80, 60)}, "focal"),
        ({"camera": Intrinsics(160, 120, 144, 144, 80, 1e300)}, "principal"),
        ({"camera": Intrinsics(160, 120, 144, 144, np.inf, 60)}, "principal"),
        *(({"depth": np.ones(shape, np.float32)}, "depth image") for shape in ((0, 0), (120, 160, 1), (19200,))),
        ({"max_range": 8e3, "max_bytes": 2**26}, "bytes"),
    ],
)
def test_what_cannot_be_mapped_is_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        mapped(**wrong)


def test_a_list_of_voxels_beyond_the_memory_is_refused(monkeypatch):
    metric_map = mapped()
    monkeypatch.setattr(grid_map, "MAX_MEMORY", 1000)
    for take in (
        metric_map.occupied_centres,
        metric_map.free_centres,
        lambda: metric_map.log_odds(*metric_map.bounds()),
    ):
        with pytest.raises(InputError, match="would take"):
            take()


def test_a_full_map_refuses_a_whole_frame():
    metric_map = mapped(max_bytes=2**20 + 2**18)
    before = content(metric_map)
    elsewhere = T.copy()
    elsewhere[:2, 3] += 100
    with pytest.raises(InputError, match="bytes"):
        for _ in range(10):
            elsewhere[0, 3] += 50
            metric_map.integrate(SCENE, CAMERA, elsewhere)
    lower, upper = before[0], np.array(before[0]) + before[1].shape
    np.testing.assert_array_equal(metric_map.log_odds(np.array(lower), upper), before[1])


def test_a_camera_outside_of_all_that_is_mapped_lets_the_map_grow():
    metric_map = mapped()
    before = content(metric_map)
    far = T.copy()
    far[:3, 3] += (310.0, -55.0, 12.0)
    metric_map.integrate(SCENE, CAMERA, far)
    lower, upper = np.array(before[0]), np.array(before[0]) + before[1].shape
    np.testing.assert_array_equal(metric_map.log_odds(lower, upper), before[1])
    assert np.count_nonzero(content(metric_map)[1]) > 1.9 * np.count_nonzero(before[1])


@pytest.mark.parametrize(
    ("points", "origin", "message"),
    [
        *((np.zeros(shape), (0, 0, 0), "points") for shape in ((3,), (2, 2), (2, 3, 1))),
        *(([(1.0, 0, 0)], place, "origin") for place in ((0, 0), (0, 0, np.nan), (0, np.inf, 0), (1e6, 0, 0))),
    ],
)
def test_what_is_no_point_cloud_is_refused(points, origin, message):
    with pytest.raises(InputError, match=message):
        MetricMap().integrate_points(points, origin)


@given(hnp.arrays(np.float64, (5, 3), elements=st.floats() | st.floats(-2, 2)))
def test_points_that_are_no_places_have_no_effect(points):
    whole, kept = MetricMap(), MetricMap()
    whole.integrate_points(points, (0, 0, 0))
    kept.integrate_points(points[(np.abs(points) <= 1e5).all(axis=1)], (0, 0, 0))
    assert_same(whole, kept)


@pytest.mark.parametrize(
    "wrong",
    [
        {"voxel_size": 0.0},
        {"voxel_size": np.nan},
        {"voxel_size": 1e9},
        {"voxel_size": 1e-300},
        {"max_range": -1.0},
        {"max_range": 1e300},
        {"margin": -0.1},
        {"miss": 0},
        {"hit": 50, "max_log_odds": 40},
        {"max_log_odds": 200},
        {"offset": (0.0, np.nan, 0.0)},
        {"max_bytes": 0},
    ],
)
def test_settings_that_cannot_work_are_named(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        MetricMap(MetricMapConfig(**wrong))


def test_a_frame_leaves_what_it_was_given_as_it_was():
    depth, pose = SCENE.copy(), T.copy()
    mapped(depth, pose)
    np.testing.assert_array_equal(depth, SCENE)
    np.testing.assert_array_equal(pose, T)


def test_images_of_other_types_and_layouts_are_read():
    assert_same(mapped(np.asfortranarray(SCENE)), mapped())
    assert_same(mapped(SCENE.astype(np.float64)), mapped())


def test_a_map_is_the_same_however_often_it_is_made():
    def whole():
        metric_map = MetricMap()
        for pose in tour(6):
            metric_map.integrate(depth_image(pose), CAMERA, pose)
        return metric_map

    assert_same(whole(), whole())
