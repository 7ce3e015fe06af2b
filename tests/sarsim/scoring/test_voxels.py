import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from sarsim.scoring.voxel_kernels import mark_rays
from sarsim.scoring.voxels import VoxelScore


@given(hnp.arrays(np.float64, (2, 3), elements=st.floats(0.01, 7.99)))
def test_crossed_voxels_are_those_that_fine_sampling_finds(ends):
    crossed, ended = np.zeros((2, 8, 8, 8), np.bool_)
    start, end = ends
    mark_rays(end[None], start, np.zeros(3), 1.0, np.zeros(3, np.int64), crossed, ended)
    samples = start + np.linspace(0, 1, 4001)[:, None] * (end - start)
    expected = np.zeros_like(crossed)
    expected[tuple(samples.astype(int).T)] = True
    last = tuple(end.astype(int))
    assert np.argwhere(ended).tolist() == [list(last)]
    assert not crossed[last] or last == tuple(start.astype(int))
    expected[last] = crossed[last] = False
    # Sampling may miss a corner that a ray only grazes; the traversal must not miss a voxel that sampling finds.
    assert not (expected & ~crossed).any()
    # The traversal passes at most seven corners, at each through two more voxels, which the ray touches.
    assert crossed.sum() - expected.sum() <= 14
    for voxel in np.argwhere(crossed & ~expected):
        outside = np.maximum(0, np.maximum(voxel - samples, samples - voxel - 1))
        assert np.linalg.norm(outside, axis=1).min() < 0.004


def scored(points, camera):
    metric_map = MetricMap(MetricMapConfig(max_range=20))
    score = VoxelScore(metric_map)
    score.add(np.asarray(points, np.float32), np.asarray(camera, np.float64))
    return metric_map, score


def test_a_map_of_the_very_rays_is_perfect():
    y, z = np.meshgrid(np.arange(-0.5, 0.5, 0.02), np.arange(0, 1, 0.02))
    wall = np.column_stack([np.full(y.size, 2.03), y.ravel(), z.ravel()]).astype(np.float32)
    metric_map, score = scored(wall, (0, 0, 0.5))
    for _ in range(3):
        metric_map.integrate_points(wall, (0, 0, 0.5))
    assert score.report() == pytest.approx(
        {"occupied_recall": 1, "occupied_precision": 1, "false_free_rate": 0, "free_recall": 1}
    )


def test_an_empty_map_recalls_nothing_and_is_not_false():
    _, score = scored([(2.03, 0, 0.5)], (0, 0, 0.5))
    report = score.report()
    assert report["occupied_recall"] == report["free_recall"] == report["false_free_rate"] == 0


def test_a_surface_beside_the_true_one_is_precise_but_not_recalled_and_further_off_it_is_false():
    for shift, precision in ((0.1, 1.0), (0.3, 0.0)):
        metric_map, score = scored([(2.03, 0, 0.5)], (0, 0, 0.5))
        for _ in range(3):
            metric_map.integrate_points([(2.03 + shift, 0, 0.5)], (0, 0, 0.5))
        report = score.report()
        assert report["occupied_precision"] == precision
        assert report["occupied_recall"] == 0
        assert report["false_free_rate"] == 1


def test_occupied_voxels_far_from_all_rays_count_against_the_map():
    metric_map, score = scored([(2.03, 0, 0.5)], (0, 0, 0.5))
    metric_map.integrate_points([(2.03, 0, 0.5)], (0, 0, 0.5))
    metric_map.integrate_points([(-5, -5, 0.5)], (-4, -5, 0.5))
    assert score.report()["occupied_precision"] == 0.5


def test_a_robot_that_saw_nothing_has_no_figures():
    assert VoxelScore(MetricMap()).report() == {}
    assert scored(np.zeros((0, 3)), (0, 0, 0))[1].report() == {}
