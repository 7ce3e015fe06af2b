"""Specks: returns of dust, rain or snow in the air, which stand alone in the depth image."""

from dataclasses import replace

import numpy as np

from pipeline.frame import Frame
from pipeline.metric_map import isolated_returns_kernels as kernels

REACH, LEAST = 2, 2
"""Distance in pixels to a return's neighbours, and how many of these must have a similar depth. Of a surface of which
dust hides four fifths, 93 % of the returns remain; of specks that fill 2 % of the image, one in 2000."""
TOLERANCE = np.float32(0.05)  # Share of a return's depth by which similar depths may differ from it


def without_isolated_returns(frame: Frame) -> Frame:
    """The frame without the returns that have too few neighbours of similar depth in the image."""
    return replace(frame, depth=kernels.without_isolated_returns(frame.depth, REACH, TOLERANCE, LEAST))
