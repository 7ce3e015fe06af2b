"""Overhangs: which ground in a frame lies under something too low for the robot.

A table top just below the camera is seen at such a grazing angle that it gives no returns, so its column shows only
the floor below it. Its edge does give returns, which hide part of the space straight above that floor.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Points
from pipeline.elevation_map import overhangs_kernels as kernels
from pipeline.elevation_map.config import OverhangConfig
from pipeline.frame import Frame
from pipeline.transforms import inverse, transform_points


def find_overhangs(frame: Frame, points: Points, headroom: float, config: OverhangConfig) -> NDArray[np.uint8]:
    """What a frame shows of the space above its returns (N, 3), m in ``base_link``, up to ``headroom`` m.

    Returns:
        (N,) ``kernels.ROOFED`` if a nearer surface hides part of it, ``kernels.OPEN`` if the frame sees through all
        of it, or ``kernels.UNSURE``.
    """
    k, sensor = frame.intrinsics, frame.sensor
    in_camera = transform_points(inverse(frame.T_base_camera), points).astype(np.float64)
    up = (frame.T_odom_base[:3, :3] @ frame.T_base_camera[:3, :3])[2].copy()
    noise = config.deviations * sensor.sigma(in_camera[:, 2])
    limits = kernels.Limits(
        headroom=headroom,
        nearest=sensor.nearest,
        farthest=sensor.farthest - sensor.margin,
        nearer=config.nearer,
        reach=config.reach,
        fewest=config.fewest,
        beside=config.beside,
    )
    return kernels.overhangs(in_camera, noise, frame.depth, np.array([k.fx, k.fy, k.cx, k.cy]), up, limits)
