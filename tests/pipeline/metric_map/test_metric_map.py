"""Small cases by hand."""

import numpy as np
from scipy.spatial import KDTree

from pipeline.frame import Intrinsics
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import FREE, OCCUPIED, UNKNOWN, MetricMap

CAMERA = Intrinsics(width=64, height=48, fx=57.7, fy=57.9, cx=32.0, cy=24.0)

T_MAP_CAMERA = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1]])
"""At (0, 0, 0.5) m, looking along x of ``map``."""


def wall(depth: float = 2.0) -> np.ndarray:
    return np.full((48, 64), depth, np.float32)


def test_wall_ahead_is_occupied_space_before_it_free_and_behind_it_unknown() -> None:
    grid = MetricMap()
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    states = grid.p_free_at([(1, 0, 0.5), (1.9, 0, 0.5), (2, 0, 0.5), (2.11, 0, 0.5), (-0.2, 0, 0.5), (1, 1, 0.5)])
    assert states.tolist() == [FREE, FREE, OCCUPIED, UNKNOWN, UNKNOWN, UNKNOWN]


def test_wall_is_a_surface_for_the_side_from_which_it_was_seen_alone() -> None:
    grid, places = MetricMap(), np.array([(1, 0, 0.5), (2, 0, 0.5), (2.11, 0, 0.5)])
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    assert grid.is_surface(places, np.array([-1.0, 0, 0])).tolist() == [False, True, False]
    assert not grid.is_surface(places, np.array([1.0, 0, 0])).any()


def test_return_beyond_the_range_frees_up_to_the_range_and_ends_nowhere() -> None:
    grid = MetricMap(MetricMapConfig(max_range=3.0))
    grid.integrate(wall(5.0), CAMERA, T_MAP_CAMERA)
    assert grid.p_free_at([(2.9, 0, 0.5), (3.2, 0, 0.5), (5, 0, 0.5)]).tolist() == [FREE, UNKNOWN, UNKNOWN]
    assert len(grid.occupied_centres()) == 0


def test_points_mark_their_voxels_and_free_the_way() -> None:
    grid = MetricMap()
    grid.integrate_points([(1.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    assert len(grid.occupied_centres()) == 1
    np.testing.assert_allclose(grid.free_centres(), [(0.025 + 0.1 * i, 0.025, 0.01) for i in range(10)], atol=1e-6)


def test_hits_outweigh_crossings_and_both_are_clamped() -> None:
    grid = MetricMap()
    voxel = grid.voxel_index([(1.0, 0.0, 0.0)])
    values = []
    for end in [1.0] * 5 + [2.0] * 60 + [1.0]:
        grid.integrate_points([(end, 0.0, 0.0)], (0.0, 0.0, 0.0))
        values.append(int(grid.log_odds_at(voxel)[0]))
    assert values[:6] == [10, 20, 30, 40, 40, 39]
    assert values[44:46] == [0, -1] and values[-2:] == [-9, 1]
    assert grid.p_free_at([(1.0, 0.0, 0.0)]).tolist() == [OCCUPIED]


def test_a_line_of_sight_is_free_up_to_the_target_and_not_through_walls_or_unknown_space() -> None:
    grid, eye = MetricMap(), np.array([0.05, 0, 0.5])
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    on_wall, in_wall, behind = (np.array([x, 0, 0.5]) for x in (2.0, 2.05, 3.0))
    aside = np.array([1.0, 2, 0.5])

    def is_free(end: np.ndarray, **settings: float | bool) -> bool:
        return bool(grid.are_sightlines_free(eye[None], end, KDTree(end[None]), 0.15, **settings)[0])

    assert is_free(np.array([1.5, 0, 0.5]))
    assert is_free(on_wall) and not grid.are_sightlines_free(eye[None], in_wall, KDTree(behind[None]), 0.15).any()
    from_both = grid.are_sightlines_free(np.array([eye, aside, on_wall]), on_wall, KDTree(on_wall[None]), 0.15)
    assert from_both.tolist() == [True, False, True]
    assert not is_free(behind) and not is_free(behind, may_be_unknown=True)
    assert not is_free(aside) and is_free(aside, may_be_unknown=True)
    grid.set_log_odds(grid.voxel_index([(0.3, 0, 0.5)])[0], np.full((1, 1, 1), 40, np.int8))
    assert not is_free(on_wall) and is_free(on_wall, skip=0.5)


def test_centres_are_those_of_the_voxels_in_each_state() -> None:
    grid = MetricMap()
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    lower, upper = grid.bounds()
    log_odds = grid.log_odds(lower, upper)
    for sign, centres in ((1, grid.occupied_centres()), (-1, grid.free_centres())):
        index = np.argwhere(np.sign(log_odds) == sign)
        assert sorted((grid.voxel_index(centres) - lower).tolist()) == index.tolist()
        np.testing.assert_array_equal(grid.voxel_centre(grid.voxel_index(centres)), centres)
    assert set(np.unique(np.sign(log_odds))) == {-1, 0, 1}


def test_returns_besides_the_image_are_end_points_up_to_its_range():
    camera, depth = Intrinsics(8, 8, 8.0, 8.0, 4.0, 4.0), np.full((8, 8), 3.0, np.float32)
    T_map_camera = np.eye(4)  # looks along z
    plain, denser = MetricMap(), MetricMap()
    plain.integrate(depth, camera, T_map_camera)
    near, far = np.float32([(0.01, 0.01, 1.0)]), np.float32([(0.01, 0.01, 3.6), (50.0, 0.0, 1.0)])
    denser.integrate(depth, camera, T_map_camera, np.concatenate([near, far]))
    assert plain.p_free_at(near) == FREE and denser.p_free_at(near) == OCCUPIED
    assert (denser.p_free_at(far) != OCCUPIED).all()


def test_only_the_columns_that_a_box_touches_are_rebuilt():
    metric_map = MetricMap()
    places = np.array([(0.5, 0.5, 0.5), (2.5, 0.5, 0.5)])
    for place in places:
        metric_map.integrate_points(place[None], place - (0.0, 0.0, 1.0))
    box = np.array([[(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)]])
    with metric_map.rebuilding(box) as meets:
        assert meets(np.stack([places - 0.1, places + 0.1], axis=1)).tolist() == [True, False]
        for _ in range(3):
            metric_map.integrate_points(places[1:], places[1] - (0.0, 0.0, 1.0))  # elsewhere nothing changes
    assert metric_map.p_free_at(places).tolist() == [UNKNOWN, OCCUPIED]
    hits = metric_map.log_odds_at(metric_map.voxel_index(places[1:]))
    metric_map.integrate_points(places[1:], places[1] - (0.0, 0.0, 1.0))
    assert metric_map.log_odds_at(metric_map.voxel_index(places[1:])) > hits


def test_what_has_gone_is_seen_through() -> None:
    grid, there = MetricMap(), np.array([(1.5, 0, 0.5), (1.5, 0.1, 0.6), (2.5, 0, 0.5)])
    for depth, looks in ((1.5, 3), (2.5, 1)):
        for _ in range(looks):
            grid.integrate(wall(depth), CAMERA, T_MAP_CAMERA)
    assert not grid.is_seen_through(there).any()  # a single frame may be wrong
    for _ in range(45):
        grid.integrate(wall(2.5), CAMERA, T_MAP_CAMERA)
    assert grid.is_seen_through(there).tolist() == [True, True, False]
