"""A scene of a dataset as a recording, to be mapped like any other."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.datasets.recording import Recording
from pipeline.frame import Frame
from pipeline.localisation.trajectory import Trajectory
from sarsim.dataset.scene_file import Scene


def read_scene(path: Path) -> Recording:
    """The frames, dead reckoning and true poses of a scene's file; InputError if it is missing or broken."""

    def frames() -> Iterator[Frame]:
        with Scene(path) as scene:
            yield from (replace(frame, T_odom_base=np.eye(4)) for frame in scene)

    with Scene(path) as scene:
        odometry, truth = (Trajectory(scene.time, poses) for poses in (scene.pose_odom, scene.pose_true))
    return Recording(path, frames, has_camera_pose=True, odometry=odometry, truth=truth)
