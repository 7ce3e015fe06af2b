"""Specks: returns of dust, rain or snow in the air, which are isolated in the depth image."""

from dataclasses import replace

import numpy as np

from pipeline.frame import Frame
from pipeline.metric_map import isolated_returns_kernels as kernels
from pipeline.metric_map.config import IsolatedReturnsConfig


def remove_isolated_returns(frame: Frame, config: IsolatedReturnsConfig) -> Frame:
    """The frame without the returns that have too few neighbours of similar depth in the image."""
    same_surface = np.float32(frame.sensor.same_surface)
    depth = kernels.remove_isolated_returns(frame.depth, config.reach, same_surface, config.fewest_alike)
    return replace(frame, depth=depth)
