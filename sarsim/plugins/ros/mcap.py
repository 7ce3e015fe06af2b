"""Scenes as ROS 2 bags, as if recorded by a robot."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.datasets.recorded_robot import OdometrySample
from pipeline.plugins.ros.bag import Bag
from pipeline.plugins.ros.topics import RobotTopics
from pipeline.robot import Velocity
from sarsim.dataset.exports.export import Export, room_name
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene


@dataclass(frozen=True)
class Mcap(Export):
    """For each scene a ROS 2 bag: a folder with metadata.yaml and an MCAP file."""

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write a bag for the scene: images and labels, intrinsics, odometry, transforms, and the true poses."""
        path = folder / room_name(entry)
        path.parent.mkdir(parents=True, exist_ok=True)
        with Bag(path) as bag:
            topics = RobotTopics(bag.write)
            for index, frame in enumerate(scene):
                # The robot's velocity between two frames is unknown.
                unknown = Velocity(np.nan, np.nan)
                topics.take_odometry(
                    OdometrySample(frame.time, frame.T_odom_base, unknown, None, scene.pose_true[index])
                )
                topics.take_frame(frame)
