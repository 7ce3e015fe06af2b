"""Settings of the commands for ROS 2 robots."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Fixed

from pipeline.plugins.ros.config import RosConfig
from pipeline.plugins.ros.live.topic_names import TopicNames
from sarsim.flags import Given
from sarsim.settings import MissionConfig, PerceptionConfig, RobotName, SimulatorConfig, SinkConfig


@dataclass(frozen=True, kw_only=True)
class RosRobotConfig(SimulatorConfig):
    """Settings of the node that simulates a robot.

    Attributes:
        camera_rate: camera images per simulated second. Each takes about 50 ms to compute; a real Xtion
            delivers 30 a second.
        pace: pace of simulated time: the wall clock's (real-time), as fast as possible (free), or one step per
            command (commands), waiting at most 0.1 s for each.
        stamped: receive commands as TwistStamped instead of Twist.
        name: name of the ROS 2 node.
        network: connect to other machines too; they can then drive the robot. By default only to this machine.
        out: new folder for the ground truth of the drive: report.json and trajectory_true.tum. Without it, neither
            is written.
        plugins: the plug-ins to use and their settings, by name; ``--NAME`` adds one.
        ros: all parameters of ROS; set them in a ``--config`` file.
    """

    camera_rate: float = 5.0
    pace: Literal["commands", "real-time", "free"] = "commands"
    stamped: bool = False
    name: str = "sarsim_robot"
    network: bool = False
    out: Given[Path] = None
    plugins: Fixed[Mapping[str, Any]] = field(default_factory=dict)
    ros: Fixed[RosConfig] = RosConfig()


@dataclass(frozen=True, kw_only=True)
class RosExplorationConfig(SinkConfig, PerceptionConfig, MissionConfig):
    """Settings of the exploration with a ROS 2 robot.

    Attributes:
        out: new folder for the results: the same files as an episode writes.
        robot: robot that determines which ground is traversable: pioneer3at, jackal, or the path of an MJCF file.
        camera_pose: pose of the camera on the robot: x y z in m, roll pitch yaw in degrees; a positive pitch looks
            down. By default from the robot's transforms.
        topics: names of the robot's topics.
        nav2: send goals to the robot's Nav2 stack instead of velocity commands.
        patience: longest silence of the robot or one of its topics, s; after that, the drive ends.
        name: name of the ROS 2 node.
        network: connect to other machines too. By default only to this machine.
        ros: all parameters of ROS; set them in a ``--config`` file.
    """

    out: Path
    robot: RobotName = "pioneer3at"
    camera_pose: Given[tuple[float, float, float, float, float, float]] = None
    topics: TopicNames = field(default_factory=TopicNames)
    nav2: bool = False
    patience: float = 5.0
    name: str = "sarsim_explorer"
    network: bool = False
    ros: Fixed[RosConfig] = RosConfig()

    @property
    def folder(self) -> Path:
        """Folder for the results."""
        return self.out
