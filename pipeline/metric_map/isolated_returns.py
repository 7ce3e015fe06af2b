"""Removes specks: returns of dust, rain or snow in the air, which are isolated in the depth image.

If dust hides four fifths of a surface, 93% of its remaining returns are kept; if specks fill 2% of the image, one in
2,000 of them is kept.
"""

from dataclasses import replace

import numpy as np

from pipeline.frame import Frame
from pipeline.metric_map import isolated_returns_kernels as kernels

REACH = 2
"""Maximum distance of a return's neighbours along rows and columns, pixels."""
MIN_ALIKE = 2
"""Minimum number of neighbours that must have a similar depth."""


def remove_isolated_returns(frame: Frame) -> Frame:
    """The frame without the returns that have too few neighbours of similar depth in the image."""
    same_surface = np.float32(frame.sensor.max_relative_depth_step)
    depth = kernels.remove_isolated_returns(frame.depth, REACH, same_surface, MIN_ALIKE)
    return replace(frame, depth=depth)
