"""An expedition of a ROS 2 robot, without ground truth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.datasets.recording import CameraPose
from pipeline.errors import InputError
from pipeline.explorer import Explorer, Observer, Step
from pipeline.files import check_folder, make_folder
from pipeline.league.brief import MissionBrief
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.map_file import KEYFRAMES, load_keyframes
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.navigator import Outcome
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.viewer import Viewer
from pipeline.robot import Motion
from pipeline.ros.live.node import RosNode
from pipeline.ros.live.ros_robot import RosRobot
from pipeline.ros.messages import MAP, ODOM, transforms
from pipeline.ros.topics import MapTopics
from pipeline.run import Expedition, ResultFolder
from sarsim.methods.make import make_exploration
from sarsim.methods.perception import make_perception, make_readers
from sarsim.robots.model import robot_model
from sarsim.settings import RosExploration

STARTING_TIME = 120.0
"""s that a robot which is not there yet may take to start: a simulated one compiles first."""


class InterruptedDriveError(Exception):
    """The drive was interrupted."""


class TimedPose(NamedTuple):
    """A 4×4 pose by odometry at a time in s."""

    time: float
    T_odom_base: NDArray[np.float64]


class RosDrive(Expedition, Observer):
    """An expedition that publishes its maps and its plan.

    Attributes:
        robot: on the network.
        stopped: why the robot was stopped before the end; None if it was not.
    """

    def __init__(self, config: RosExploration, node: RosNode, brief: MissionBrief | None = None):
        """Raises InputError if no robot is found, or a file cannot be read or written."""
        check_folder(config.out)
        classifier, detector = make_perception(config)
        camera = config.camera and CameraPose(*config.camera).T_base_camera
        model = replace(robot_model(config.robot), speed=config.speed)
        self.robot = RosRobot(node, model, config.topics, camera, config.patience, STARTING_TIME, self._log_motion)
        mapper = Mapper(model, classifier, detector, readers=make_readers(config))
        explorer = Explorer(self.robot, mapper, make_exploration(config.exploration, model))
        if config.map:
            load_keyframes(config.map / KEYFRAMES, mapper)
        explorer.observers.append(self)
        viewer = None if config.view == "none" else Viewer(config.view)
        make_folder(config.out)
        recorder = Recorder(config.out / "episode.rrd", viewer)
        results = ResultFolder(config, config.out, config.out.name, 0, mapper, recorder, brief)
        self._node, self._maps, self._frontiers = node, MapTopics(node.send), 0
        self._poses: list[TimedPose] = []
        self._estimate = EstimatedTrajectory(mapper.localisation, self._poses)
        super().__init__(explorer, results, self._estimate, config.steps, config.goals, config.home)
        self.stopped: str | None = None

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_step: Callable[[str], object] = lambda description: None,
    ) -> bool:
        """Like every expedition, except that the robot stops at once when it is ``interrupted``.

        Raises:
            InputError: the robot sends nothing more, or does not follow commands; the maps so far are kept.
        """
        self._interrupted = interrupted
        try:
            return super().run(interrupted, on_step)
        except InterruptedDriveError:
            return False
        finally:
            self.robot.stop()

    def step(self) -> bool:
        """One step of the robot; InputError if the robot had to be stopped."""
        try:
            return super().step()
        except InputError as error:
            self.stopped = str(error)
            raise
        except InterruptedDriveError:
            self.robot.stop()
            raise

    def _log_motion(self, motion: Motion) -> None:
        self._poses.append(TimedPose(motion.time, motion.T_odom_base))
        if self.explorer.steps:
            link = {(MAP, ODOM): self.explorer.mapper.localisation.T_map_odom}
            self._node.send("/tf", motion.time, transforms(motion.time, link))
        if self._interrupted():
            raise InterruptedDriveError

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Publish the newest keyframe."""
        self._estimate.add(TimedPose(keyframe.frame.time, keyframe.frame.T_odom_base))
        self._maps.keyframe(keyframe)

    def on_step(self, explorer: Explorer, step: Step) -> None:
        """Publish the maps and the plan."""
        self._frontiers = len(step.frontiers)
        self._maps.maps(explorer.mapper, step.keyframe, step.plan)

    def _time(self) -> float:
        return self.robot.time

    def _stages(self) -> dict[str, Any]:
        navigator, localisation = self.explorer.navigator, self.explorer.mapper.localisation
        outcomes = [leg.outcome for leg in navigator.legs]
        return {
            "navigation": {
                "legs": len(outcomes),
                "reached": outcomes.count(Outcome.REACHED),
                "stuck": outcomes.count(Outcome.STUCK),
                "recovered": navigator.recovered,
            },
            "exploration": {"frontiers_left": self._frontiers},
            "localisation": {"keyframes": len(localisation.poses), "loops": len(localisation.loops)},
            **({"stopped": self.stopped} if self.stopped else {}),
        }
