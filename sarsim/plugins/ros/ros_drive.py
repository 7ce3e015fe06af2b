"""A run of a ROS 2 robot, without ground truth."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

from pipeline.arrays import Pose
from pipeline.datasets.messages import MAP, ODOM, Message
from pipeline.datasets.recording import CameraPose
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.files import check_folder
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.commands import Outcome
from pipeline.plugin import Plugin
from pipeline.plugins.ros.config import RosConfig
from pipeline.plugins.ros.live.nav2 import Nav2Navigator, Nav2Robot
from pipeline.plugins.ros.live.node import RosNode
from pipeline.plugins.ros.live.ros_robot import RosRobot
from pipeline.plugins.ros.messages import transforms
from pipeline.plugins.ros.topics import MapTopics, Send
from pipeline.progress import Progress
from pipeline.robot import Motion
from pipeline.run import ExplorerRun
from pipeline.sensor import XTION
from pipeline.sink import Result, Sink, Step
from sarsim.composition import compose, make_mapper
from sarsim.methods.make import make_exploration
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.ros.settings import RosExplorationConfig
from sarsim.robots.model import paced_model, robot_sensor

_log = logging.getLogger(__name__)
START_TIMEOUT = 120.0
"""s, additional time to wait for a robot that has not started yet, because a simulated robot compiles first."""


class InterruptedDriveError(Exception):
    """The drive was interrupted."""


class TimedPose(NamedTuple):
    """A 4×4 odometry pose at a time in s."""

    time: float
    T_odom_base: Pose


class _Topics(Sink):
    """Publishes the maps and the plan, and reports the outcomes of the drives."""

    def __init__(
        self,
        send: Send,
        explorer: Explorer,
        estimate: EstimatedTrajectory[TimedPose],
        config: RosConfig,
        plugins: Sequence[Plugin],
    ):
        self._maps, self._frontier_count = MapTopics(send, config=config), 0
        self._send, self._plugins = send, plugins
        self._explorer, self._estimate = explorer, estimate

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Publish the newest keyframe."""
        self._estimate.add(TimedPose(keyframe.frame.time, keyframe.frame.T_odom_base))
        self._maps.send_keyframe(keyframe)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Publish the maps and the plan."""
        self._frontier_count = len(step.frontiers)
        self._maps.send_maps(mapper, step.keyframe, step.plan)
        for plugin in self._plugins:
            for topic, message in plugin.messages(mapper, step):
                self._send(topic, step.keyframe.frame.time, message)

    def finish(self, result: Result) -> None:
        """Add the numbers of legs, frontiers, keyframes and loop closures to the report."""
        navigator, localisation = self._explorer.pilot.navigator, result.mapper.localisation
        outcomes = [leg.outcome for leg in navigator.legs]
        figures = {
            "navigation": {
                "legs": len(outcomes),
                "reached": outcomes.count(Outcome.REACHED),
                "stuck": outcomes.count(Outcome.STUCK),
                "recovered": navigator.recoveries,
            },
            "exploration": {"frontiers_left": self._frontier_count},
            "localisation": {"keyframes": len(localisation.poses), "loops": len(localisation.loops)},
        }
        if result.is_reported:
            result.add(figures)


class RosDrive(ExplorerRun):
    """A run of a robot on a ROS 2 network; it publishes the maps and the plan.

    Attributes:
        robot: the robot on the network.
        stopped: message of the InputError that ended the run; None if there was none.
    """

    def __init__(self, config: RosExplorationConfig, node: RosNode):
        """Connect to the robot; InputError if no robot is found, or a file cannot be read or written."""
        check_folder(config.out)
        camera = config.camera_pose and CameraPose(*config.camera_pose).T_base_camera
        model, live, own = paced_model(config.robot, config.speed), config.ros.live, robot_sensor(config.robot)
        if own is not None and live.depth_range is None:
            live = replace(live, depth_range=(own.nearest, own.farthest))
        self.robot = (Nav2Robot if config.nav2 else RosRobot)(
            node, model, config.topics, camera, config.patience, START_TIMEOUT, self._log_motion, config=live
        )
        plugins = make_plugins(config)
        sensor = self.robot.sensor or XTION
        mapper = make_mapper(config, model, earlier=config.map, plugins=plugins, sensor=sensor)
        strategy = make_exploration(config.exploration, model, config=config.pipeline.exploration)
        navigator = None
        if isinstance(self.robot, Nav2Robot):
            navigator = Nav2Navigator(self.robot, config.pipeline.navigation, config.ros.live.nav2)
        explorer = Explorer(self.robot, mapper, strategy, navigator=navigator)
        self._node, self._poses = node, list[TimedPose]()
        estimate = EstimatedTrajectory(mapper.localisation, self._poses)
        others = [_Topics(self._send, explorer, estimate, config.ros, plugins)]
        parts = compose(
            config,
            mapper,
            config.out,
            config.out.name,
            view=config.view,
            others=others,
            plugins=plugins,
            explorer=explorer,
        )
        super().__init__(explorer, parts, estimate, config.max_steps, config.goals, config.home)
        self.stopped: str | None = None

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_progress: Callable[[Progress], object] = lambda progress: None,
    ) -> bool:
        """Run as :class:`pipeline.run.ExplorerRun` does, but stop the robot at once if ``interrupted`` returns True.

        Raises:
            InputError: the robot stops sending data, or does not follow commands; the maps so far are kept.
        """
        self._interrupted = interrupted
        try:
            return super().run(interrupted, on_progress)
        except InterruptedDriveError:
            return False
        finally:
            self.robot.stop()

    def _explore(self, may_step: Callable[[], bool], on_done: Callable[[], object]) -> None:
        try:
            super()._explore(may_step, on_done)
        except BaseException as error:
            self.robot.stop()  # at once, because writing the results takes time
            if isinstance(error, InputError):
                self.stopped = str(error)
            raise

    def _log_motion(self, motion: Motion) -> None:
        self._poses.append(TimedPose(motion.time, motion.T_odom_base))
        if self.explorer.steps:
            link = {(MAP, ODOM): self.mapper.T_map_odom}
            self._send("/tf", motion.time, transforms(motion.time, link))
        if self._interrupted():
            raise InterruptedDriveError

    def _send(self, topic: str, time: float, message: Message) -> None:
        """Send data in sarsim's frame ``map``, unless the robot has its own map, which Nav2 would confuse with it."""
        if not self._has_other_map:
            self._node.publish(topic, time, message)

    @cached_property
    def _has_other_map(self) -> bool:
        has_other = isinstance(self.robot, Nav2Robot) and self.robot.has_map
        if has_other:
            _log.warning("the robot has its own map, so sarsim publishes no map; goals are in the odometry frame")
        return has_other

    def _time(self) -> float:
        return self.robot.time

    def _figures(self) -> dict[str, Any]:
        return super()._figures() | ({"stopped": self.stopped} if self.stopped else {})
