"""A drive around a room as recordings: a TUM folder and a bag."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from pipeline.datasets.recorded_robot import OdometrySample
from pipeline.frame import Frame
from pipeline.plugins.ros.bag import Bag
from pipeline.plugins.ros.topics import ImageFormat, RobotTopics
from pipeline.robot import Motion, Velocity
from tests.pipeline.localisation.driving_robot import T_BASE_CAMERA, drifting, drive, seen
from tests.pipeline.localisation.painted_room import painted

PERIOD = 0.1
WAY = drive(*[(0.15, 0.0)] * 8, *[(0.05, np.pi / 24)] * 6)
"""True poses, one every ``PERIOD`` s."""
ODOMETRY = drifting(WAY, stretch=1.02, veer=np.deg2rad(0.05))


@cache
def frames() -> list[Frame]:
    """The frames of the drive, with an odometry that drifts."""
    found = []
    for k, (true, believed) in enumerate(zip(WAY, ODOMETRY, strict=True)):
        found.append(replace(painted(seen(true, believed, time=k), true), time=round(k * PERIOD, 3)))
    return found


def camera_poses(poses: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The camera's poses, given those of the robot."""
    return [T @ T_BASE_CAMERA for T in poses]


def write_tum_folder(folder: Path, number: int | None = None, **files: Iterable[NDArray[np.float64]]) -> Path:
    """Write the first frames, all by default, and trajectories by name: ``groundtruth`` and ``odometry``."""
    return write_images(folder, frames()[:number], **files)


def write_images(folder: Path, views: list[Frame], **files: Iterable[NDArray[np.float64]]) -> Path:
    """Write frames of one camera, and trajectories by name."""
    lists: dict[str, list[str]] = {"rgb": [], "depth": []}
    for kind in lists:
        (folder / kind).mkdir(parents=True)
    for frame in views:
        for kind, image in (("rgb", frame.rgb), ("depth", np.rint(frame.depth * 5000).astype(np.uint16))):
            cv2.imwrite(str(folder / kind / f"{frame.time:.3f}.png"), image)
            lists[kind].append(f"{frame.time:.3f} {kind}/{frame.time:.3f}.png")
    for name, poses in files.items():
        numbers = [[*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()] for T in poses]
        lists[name] = [" ".join(map(str, [f.time, *row])) for f, row in zip(views, numbers, strict=True)]
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(["# made by a test", *lines]) + "\n")
    k = views[0].intrinsics
    (folder / "calibration.txt").write_text(f"{k.fx} {k.fy} {k.cx - 0.5} {k.cy - 0.5}\n")
    return folder


SQLITE: dict[str, Any] = {
    "dst_storage": "sqlite3", "dst_version": 9, "compress": None, "compress_mode": "file",
    "default_typestore": None, "typestore": None, "exclude_topics": (), "include_topics": (),
    "exclude_msgtypes": (), "include_msgtypes": (),
}  # fmt: skip
TO_ROS_1 = SQLITE | {"typestore": get_typestore(Stores.ROS1_NOETIC)}
"""How rosbags converts a bag."""

Change = Callable[[str, float, Any], Iterable[tuple[str, float, Any]]]
"""Takes a topic, a time in s and a message; returns the messages that are written in its place."""


def unchanged(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    yield topic, time, message


def without(*topics: str) -> Change:
    return lambda topic, time, message: [] if topic in topics else [(topic, time, message)]


def write_bag(
    path: Path, images: ImageFormat = "32FC1", change: Change = unchanged, number: int | None = None
) -> Path:
    """Write the first frames, all by default, as the topics of a robot, each message as ``change`` has it."""
    with Bag(path) as bag:

        def send(topic: str, time: float, message: Any) -> None:
            for changed in change(topic, time, message):
                bag.write(*changed)

        topics = RobotTopics(send, images)
        for frame, T_world_base in zip(frames()[:number], WAY[:number], strict=True):
            twist = Velocity(1.0, 0.0)
            topics.take_odometry(OdometrySample(frame.time, frame.T_odom_base, twist, None, T_world_base))
            up = frame.T_odom_base[2, :3] * 9.81
            topics.take_motion(Motion(frame.time, frame.T_odom_base, np.zeros(3), up, np.zeros(2)), Velocity())
            topics.take_frame(frame)
    return path
