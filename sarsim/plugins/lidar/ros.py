"""Scans as ROS 2 messages."""

import math
from collections.abc import Iterator

import numpy as np

from pipeline.arrays import Pose
from pipeline.datasets.messages import BASE, Message
from pipeline.plugins.ros import messages
from sarsim.plugins.lidar.config import LidarModel
from sarsim.plugins.lidar.scanner import Scan

FRAME, POINTS, SCAN = "lidar", "/points", "/scan"


def scan_messages(scan: Scan, model: LidarModel, T_base_lidar: Pose) -> Iterator[tuple[str, float, Message]]:
    """Topics, times, s, and messages of a scan: the lidar's pose, its points, and, if it has one row, its ranges."""
    time = scan.start
    yield "/tf", time, messages.transforms(time, {(BASE, FRAME): T_base_lidar})
    columns = {
        **dict(zip("xyz", scan.points.T, strict=True)),
        "intensity": scan.intensity,
        "ring": scan.ring,
        "time": scan.time,
        "label": scan.label,
        "instance": scan.instance,
    }
    yield POINTS, time, messages.cloud(time, FRAME, columns)
    if len(model.elevations) == 1:
        yield SCAN, time, laser_scan(scan, model)


def laser_scan(scan: Scan, model: LidarModel) -> Message:
    """The ranges of a lidar with one row as sensor_msgs/LaserScan; infinite where nothing returned (REP 117)."""
    ranges, intensities = np.full(model.columns, np.inf, np.float32), np.zeros(model.columns, np.float32)
    ranges[scan.column], intensities[scan.column] = scan.range, scan.intensity
    angles = model.azimuths
    increment = float(angles[1] - angles[0]) if len(angles) > 1 else 2 * math.pi
    per_column = model.column_time if scan.time.any() else 0.0
    return messages.make(
        "sensor_msgs/LaserScan",
        messages.header(scan.start, FRAME),
        float(angles[0]),
        float(angles[-1]),
        increment,
        per_column,
        1 / model.rate,
        *model.range,
        ranges,
        intensities,
    )
