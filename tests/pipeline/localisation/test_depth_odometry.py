"""The motion of a camera by its images alone."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frame import Frame
from pipeline.localisation.depth_odometry import DepthOdometry
from pipeline.localisation.localisation import LostError
from pipeline.transforms import angle_of, inverse
from tests.pipeline.localisation.driving_robot import drive, seen
from tests.pipeline.localisation.painted_room import painted

WAY = drive(*[(0.1, 0.0)] * 6, *[(0.05, np.pi / 24)] * 4)


def frames() -> list[Frame]:
    """Frames of the drive, without odometry."""
    return [painted(seen(T, np.eye(4), time=k), T) for k, T in enumerate(WAY)]


def blind(frame: Frame) -> Frame:
    return replace(frame, depth=np.zeros_like(frame.depth))


def test_it_follows_a_drive() -> None:
    odometry = DepthOdometry(WAY[0])
    for frame, true in zip(frames(), WAY, strict=True):
        off = inverse(odometry.pose(frame)) @ true
        assert np.linalg.norm(off[:3, 3]) < 0.02
        assert angle_of(off) < np.deg2rad(0.4)


def test_colours_show_its_way_where_depth_is_missing() -> None:
    odometry = DepthOdometry(WAY[0])
    for k, (frame, true) in enumerate(zip(frames()[:6], WAY, strict=False)):
        T = odometry.pose(blind(frame) if k in (3, 4) else frame)
        assert np.linalg.norm((T - true)[:3, 3]) < 0.02


def test_surfaces_disprove_an_image_that_lies() -> None:
    odometry = DepthOdometry(WAY[0])
    honest = frames()
    for k, (frame, true) in enumerate(zip(honest, WAY, strict=True)):
        T = odometry.pose(replace(frame, rgb=honest[k - 1].rgb) if k == len(WAY) - 2 else frame)
        assert angle_of(inverse(T) @ true) < np.deg2rad(0.4)


def test_it_says_so_when_it_is_lost() -> None:
    odometry = DepthOdometry(WAY[0])
    first, *_ = frames()
    odometry.pose(first)
    stripes = np.where(np.arange(320) % 64 < 32, 0.7, 1.1) * np.ones((240, 1))
    with pytest.raises(LostError, match=r"9\.00 s"):
        odometry.pose(replace(first, time=9.0, depth=stripes.astype(np.float32), rgb=np.zeros_like(first.rgb)))
    black = replace(blind(first), rgb=np.zeros_like(first.rgb))
    for _ in range(30):
        odometry.pose(black)
    with pytest.raises(LostError, match="31 frames"):
        odometry.pose(black)
