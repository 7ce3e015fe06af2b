"""Kernels are compiled once and kept on disk: a second process loads them."""

import subprocess
import sys

PROGRAM = """
import numpy as np
from pipeline.frame import Intrinsics
from pipeline.geometry import ray_kernels
from pipeline.metric_map import grid_kernels, projection_kernels
from pipeline.metric_map.metric_map import MetricMap

T = np.eye(4)
metric_map = MetricMap()
metric_map.integrate(np.ones((8, 8), np.float32), Intrinsics(8, 8, 8.0, 8.0, 4.0, 4.0), T)
metric_map.integrate_points([(1.0, 0, 0)], (0, 0, 0))
in_grid = grid_kernels.has_marks, grid_kernels.update_log_odds
kernels = (projection_kernels.mark_depth_image, ray_kernels.trace_rays, *in_grid)
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels))
print(sum(sum(kernel.stats.cache_hits.values()) for kernel in kernels))
"""


def test_a_second_process_compiles_nothing():
    exec(PROGRAM)
    output = subprocess.run([sys.executable, "-c", PROGRAM], check=True, capture_output=True).stdout
    compiled, loaded = (int(line) for line in output.split())
    assert compiled == 0
    assert loaded == 4
