"""What is kept of keyframes, and places that follow them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.ground_evidence import DrivenTrack
from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.keyframes import AnchoredPlaces, KeyframeObservation, Keyframes, Moves, nearest_keyframes
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import from_yaw
from tests.pipeline.polygon_scene import pose
from tests.pipeline.robot_model import PIONEER

CAMERA = Intrinsics(64, 48, 58.0, 58.0, 32.0, 24.0)
T_BASE_CAMERA = pose(0.1, 0, 0.65, 0, 0.3)
REACH = 3.5
UNIT, MAX_COORDINATE = 2.5e-4, 32767 * 2.5e-4


def frame(depth: np.ndarray) -> Frame:
    return Frame(0.0, np.zeros((48, 64, 3), np.uint8), depth, CAMERA, T_BASE_CAMERA, np.eye(4))


def seen(depth: np.ndarray, labelled: bool = False) -> KeyframeObservation:
    shown = frame(depth.astype(np.float32))
    points = shown.points(T_BASE_CAMERA)
    probabilities = np.full((len(points), 8), 1 / 8, np.float32) if labelled else None
    return KeyframeObservation.of(shown, points, probabilities, 5, 0.02, ElevationConfig(), PIONEER)


def test_points_are_kept_to_the_unit_wherever_the_robot_is():
    depth = np.random.default_rng(0).uniform(1, 3, (48, 64))
    kept, T = seen(depth, labelled=True), from_yaw(40, -30, 0.2, 2.0)
    true = frame(depth.astype(np.float32)).points(T @ T_BASE_CAMERA)
    found = kept.points_at(T)
    assert len(found) == len(true) == kept.hits.sum()  # so far apart that each is alone in its voxel
    assert cKDTree(found).query(true)[0].max() < UNIT


def test_what_is_no_return_or_too_far_away_is_left_out():
    depth = np.full((48, 64), np.nan)
    depth[10], depth[20], depth[30], depth[40] = 2.0, 0.0, -1.0, np.inf
    assert seen(depth).hits.sum() == 64
    far = seen(np.full((48, 64), MAX_COORDINATE + 3.0))
    assert not len(far.points) and not len(far.rays)
    mixed = np.full((48, 64), 20.0)
    mixed[24:] = 2.0
    assert (seen(mixed).rays[:, 2] * UNIT < T_BASE_CAMERA[2, 3]).all()  # rays to what is kept alone
    assert far.frame.depth.max() == pytest.approx(MAX_COORDINATE + 3.0, abs=UNIT)  # but it shows free space


def test_a_frame_without_returns_is_kept():
    nothing, metric_map = seen(np.zeros((48, 64)), labelled=True), MetricMap()
    nothing.add_to_metric_map(metric_map, np.eye(4))
    assert not len(nothing.points) and not len(metric_map.occupied_centres())


def test_every_nth_pixel_sees_what_it_saw():
    depth, shown = np.arange(48 * 64, dtype=np.float32).reshape(48, 64), frame(np.zeros((48, 64), np.float32))
    part, camera = Frame(**(vars(shown) | {"depth": depth})).every_nth(5)
    assert part.shape == (10, 13) == (camera.height, camera.width)
    np.testing.assert_array_equal(part[1, 2], depth[7, 12])
    np.testing.assert_allclose(camera.rays[1, 2], CAMERA.rays[7, 12], atol=1e-6)
    assert shown.every_nth(1)[1] == CAMERA


def test_a_stride_lets_three_pixels_see_a_voxel_at_the_end_of_the_range():
    assert MetricMap(MetricMapConfig(voxel_size=0.1)).stride(Intrinsics(640, 480, 577.0, 577.0, 320.0, 240.0)) == 5
    assert MetricMap(MetricMapConfig(voxel_size=0.01)).stride(CAMERA) == 1


poses_2d = st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=1, max_size=6)


def matrices(rows: list[tuple[float, float, float]]) -> np.ndarray:
    return np.array([from_yaw(x, y, 0, yaw) for x, y, yaw in rows])


@given(poses_2d, st.lists(st.tuples(*[st.floats(-5, 5)] * 3), max_size=5), st.tuples(*[st.floats(-5, 5)] * 3))
def test_places_stay_where_they_are_and_move_as_one_with_all_keyframes(rows, places, motion):
    poses, there, T = matrices(rows), np.reshape(places, (-1, 3)), from_yaw(*motion[:2], 0, motion[2])
    anchored = AnchoredPlaces.anchored(there, poses)
    np.testing.assert_allclose(anchored.at(poses), there, atol=1e-12)
    np.testing.assert_allclose(anchored.at(T @ poses), there @ T[:3, :3].T + T[:3, 3], atol=1e-9)


def test_a_place_follows_the_keyframe_that_stood_nearest_or_the_one_that_is_named():
    before = matrices([(0, 0, 0), (4, 0, 0)])
    after = matrices([(0, 0, 0), (4, 1, np.pi / 2)])
    places = np.array([(1.0, 0.0), (3.0, 0.0)])
    np.testing.assert_array_equal(nearest_keyframes(places, before), [0, 1])
    np.testing.assert_allclose(AnchoredPlaces.anchored(places, before).at(after), [(1, 0, 0), (4, 0, 0)], atol=1e-12)
    of_newest = AnchoredPlaces.anchored(places, before, keyframe=1)
    np.testing.assert_allclose(of_newest.at(after), [(4, -2, 0), (4, 0, 0)], atol=1e-12)
    both = AnchoredPlaces.joined([of_newest, AnchoredPlaces.anchored(places, before)])
    assert both.keyframe.tolist() == [1, 1, 0, 1]
    assert not len(AnchoredPlaces.joined([]).at(before))


def test_moves_are_noticeable_by_the_way_or_by_what_is_at_the_end_of_the_view():
    before = np.tile(np.eye(4), (4, 1, 1))
    less, more = 0.009, 0.011
    after = matrices([(0, 0, 0), (less, 0, 0), (more, 0, 0), (0, 0, more / REACH)])
    moves = Moves.between(before, after, REACH, min_displacement=0.01)
    assert moves.are_noticeable.tolist() == [False, False, True, True]
    np.testing.assert_allclose(moves.distances, [0, less, more, 0])


def filled(poses: np.ndarray) -> Keyframes:
    keyframes = Keyframes(PIONEER, REACH, 0.05, 0.01)
    for T in poses:
        keyframes.add(seen(np.full((48, 64), 2.0)), T)
    return keyframes


def test_only_keyframes_that_move_noticeably_are_placed_anew():
    poses = matrices([(0, 0, 0), (1, 0, 0)])
    keyframes, wanted = filled(poses), matrices([(0.005, 0, 0), (1.2, 0, 0)])
    moves = keyframes.apply_poses(wanted)
    np.testing.assert_array_equal(keyframes.poses, [poses[0], wanted[1]])
    np.testing.assert_allclose(moves.distances, [0, 0.2])
    with pytest.raises(InputError, match=r"shape \(2, 4, 4\), not \(1, 4, 4\)"):
        keyframes.apply_poses(wanted[:1])


def test_a_keyframes_box_holds_its_view_its_points_and_what_was_driven_near_it():
    (T,) = poses = matrices([(2, 1, 0.7)])
    keyframes = filled(poses)
    for _ in range(2):
        ((low, high),) = keyframes.boxes()
        places = [keyframes.observations[0].points_at(T), T[None, :3, 3]]
        places += [keyframes.observations[0].view_frustum(REACH) @ T[:3, :3].T + T[:3, 3]]
        places += [e.track @ T[:3, :3].T + T[:3, 3] for _, e in keyframes.ground_evidence]
        for points in places:
            assert ((points >= low) & (points <= high)).all()
        far = np.float32([(-6, 0, 0)])
        keyframes.add_ground(0, DrivenTrack(far, np.zeros(1, np.float32), far[:0], far[:0]))
    assert low[0] < T[0, 3] - 4
