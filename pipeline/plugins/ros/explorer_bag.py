"""A bag of a robot's sensor data and motions, and of the maps that an explorer builds from them."""

from collections.abc import Callable, Sequence
from pathlib import Path

from pipeline.arrays import Pose
from pipeline.datasets.recorded_robot import Joints, PoseGetter, ReportingRobot
from pipeline.mapper import Keyframe, Mapper
from pipeline.plugin import Plugin
from pipeline.plugins.ros.bag import Bag
from pipeline.plugins.ros.config import RosConfig
from pipeline.plugins.ros.topics import ImageFormat, MapTopics, RobotTopics
from pipeline.robot import Motion, Robot
from pipeline.sink import Result, Sink, Step


class ExplorerBag(Bag, Sink):
    """A bag of a robot's sensor data and motions, and of the maps that an explorer builds from them.

    Attributes:
        robot: the robot that the explorer drives, whose data are written to the bag.
        plugins: plug-ins that may have messages for the bag.
    """

    finishing = "writing the bag"

    def __init__(
        self,
        path: Path,
        images: ImageFormat,
        robot: Robot,
        mapper: Mapper,
        T_world_base: PoseGetter = lambda: None,
        joints: Callable[[], Joints | None] = lambda: None,
        *,
        config: RosConfig = RosConfig(),
    ):
        """Start a bag of a robot that navigates with the maps of ``mapper``.

        The last three positional arguments are described at :class:`ReportingRobot`.

        Raises:
            InputError: the bag cannot be written.
        """
        super().__init__(path)
        topics = RobotTopics(self.write, images)

        def T_map_odom() -> Pose | None:
            return None if mapper.T_map_start is None else mapper.T_map_odom

        self.robot = ReportingRobot(robot, topics, T_map_odom, T_world_base, joints)
        self._maps = MapTopics(self.write, config=config)
        self.plugins: Sequence[Plugin] = ()

    def on_motion(self, motion: Motion) -> None:
        """Write the measurements of the plug-ins' sensors."""
        for plugin in self.plugins:
            for topic, time, message in plugin.measurements():
                self.write(topic, time, message)

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Write the newest keyframe."""
        self._maps.send_keyframe(keyframe)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Write the maps and the plan of the newest step."""
        self._maps.send_maps(mapper, step.keyframe, step.plan)
        for plugin in self.plugins:
            for topic, message in plugin.messages(mapper, step):
                self.write(topic, step.keyframe.frame.time, message)

    def finish(self, result: Result) -> None:
        """Close the bag; InputError if it cannot be completed."""
        self.close()
