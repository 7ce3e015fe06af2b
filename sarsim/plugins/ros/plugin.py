"""A ROS 2 bag of an episode as a plug-in: ``--bag DIR``."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import Fixed

from pipeline.arrays import Pose
from pipeline.datasets.recorded_robot import Joints
from pipeline.errors import InputError, required
from pipeline.mapper import Mapper
from pipeline.plugin import Plugin, RunContext
from pipeline.plugins.ros.config import RosConfig
from pipeline.plugins.ros.explorer_bag import ExplorerBag
from pipeline.plugins.ros.topics import ImageFormat
from pipeline.robot import Robot
from pipeline.sink import Sink
from sarsim.robots.skid_steered import WHEELS
from sarsim.settings import EpisodeConfig, TeleopConfig


@dataclass(frozen=True)
class BagConfig:
    """The content of the bag.

    Attributes:
        path: new folder for a ROS 2 bag with the robot's sensor data, commands and maps.
        images: images in the bag: depth in whole mm (16UC1) or in m (32FC1); colour raw or as JPEG.
        ros: all parameters of ROS messages.
    """

    path: Annotated[Path, tyro.conf.Positional]
    images: ImageFormat = "16UC1"
    ros: Fixed[RosConfig] = RosConfig()


class BagOfEpisode(Plugin):
    """Records the robot's sensor data, commands and maps in a bag."""

    Settings = BagConfig

    def __init__(self, settings: BagConfig, command: Any) -> None:
        super().__init__(settings, command)
        if not isinstance(command, EpisodeConfig | TeleopConfig):
            raise InputError("--bag: only episodes and drives by hand are written as bags; leave it out")
        self._bag: ExplorerBag | None = None

    def wrap(self, robot: Robot, world: Any, mapper: Mapper | None) -> Robot:
        """The robot, wrapped so that the bag records it; InputError if the bag cannot be written."""

        def T_world_base() -> Pose:
            return world.trajectory[-1].T_world_base

        self._bag = ExplorerBag(
            self.settings.path,
            self.settings.images,
            robot,
            required(mapper),
            T_world_base,
            joints=lambda: Joints(WHEELS, *world.wheels),
            config=self.settings.ros,
        )
        return self._bag.robot

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """The sink that writes the maps and closes the bag."""
        bag = required(self._bag)
        bag.plugins = context.plugins
        return [bag]

    def abandon(self) -> None:
        """Remove the bag."""
        if self._bag is not None:
            self._bag.close()
            shutil.rmtree(self.settings.path)
