"""Times, poses and vectors from ROS messages, and the names of a robot's frames (REP 103 and 105)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose
from pipeline.transforms import from_rotation

Message = Any  # A message of rosbags: an instance of one of the dataclasses in its type store
CAMERA, BASE, ODOM, MAP = "camera_optical", "base_link", "odom", "map"  # Names of the frames
NS_PER_S = 10**9  # Number of nanoseconds in a second


def seconds(stamp: Message) -> float:
    """The time of a ROS timestamp, s."""
    return (stamp.sec * NS_PER_S + stamp.nanosec) / NS_PER_S


def pose_matrix(position: Message, quaternion: Message) -> Pose:
    """The pose from a position and a quaternion; all NaN if the quaternion is zero or not finite."""
    q = np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
    if not np.isfinite(q).all() or not q.any():
        return np.full((4, 4), np.nan)
    return from_rotation(Rotation.from_quat(q).as_matrix(), [position.x, position.y, position.z])


def vector_of(message: Message) -> NDArray[np.float64]:
    """A Vector3 as an array (3,)."""
    return np.array([message.x, message.y, message.z])
