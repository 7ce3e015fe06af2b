"""Specks: returns of dust, rain or snow in the air, which stand alone in the depth image."""

from dataclasses import replace

import numpy as np

from pipeline.frame import Frame
from pipeline.metric_map import specks_kernels as kernels

REACH, LEAST = 2, 2
"""Pixels around a return, and how many of these must have one like it. Of a surface that dust hides to four fifths
93 % of the returns remain; of specks that fill 2 % of the image one in 2000."""
TOLERANCE = np.float32(0.05)  # Share by which depths of one surface may differ there


def without_specks(frame: Frame) -> Frame:
    """The frame without those returns that no other return near them in the image confirms."""
    return replace(frame, depth=kernels.without_specks(frame.depth, REACH, TOLERANCE, LEAST))
