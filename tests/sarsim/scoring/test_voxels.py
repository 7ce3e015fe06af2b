import numpy as np
import pytest

from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap
from sarsim.scoring.voxels import VoxelScore


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
