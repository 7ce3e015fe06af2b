"""An expedition of a ROS 2 robot, without ground truth."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pipeline.datasets.recording import CameraPose
from pipeline.errors import InputError
from pipeline.explorer import Explorer, Step
from pipeline.localisation.slam import Slam
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.navigator import Outcome
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.viewer import Viewer
from pipeline.robot import Motion
from pipeline.ros.live.node import RosNode
from pipeline.ros.live.ros_robot import RosRobot
from pipeline.ros.messages import MAP, ODOM, transforms
from pipeline.ros.topics import MapTopics
from pipeline.victims.detection.detector import VictimDetector
from sarsim.episode import Expedition, make_classifier, make_folder
from sarsim.robots.pose import Pose
from sarsim.robots.skid_steered import robot_model
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import RosExploration


class InterruptedDriveError(Exception):
    """The drive was interrupted."""


class RosDrive(Expedition):
    """An expedition that publishes its maps and its plan.

    Attributes:
        robot: on the network.
        stopped: why the robot was stopped before the end; None if it was not.
    """

    config: RosExploration

    def __init__(self, config: RosExploration, node: RosNode):
        """Raises InputError if no robot is found, or a file cannot be read or written."""
        classifier = make_classifier(config.labels, config.weights)
        detector = VictimDetector.load(*config.detector) if config.detector else None
        make_folder(config.out)
        camera = config.camera and CameraPose(*config.camera).T_base_camera
        model = replace(robot_model(config.robot), speed=config.speed)
        self.robot = RosRobot(node, model, config.topics, camera, config.patience)
        mapper = Mapper(self.robot.model, classifier, detector, localisation=Slam())
        super().__init__(config, Explorer(self.robot, mapper))
        self.recorder = Recorder(self.out / "episode.rrd", None if config.view == "none" else Viewer(config.view))
        self.explorer.on_correction = self.recorder.log_correction
        self.robot.on_motion = self._log_motion
        self.stopped: str | None = None
        self._node, self._maps, self._frontiers = node, MapTopics(node.send), 0
        self._poses: list[Pose] = []
        self.trajectory = TrajectoryScore(self.explorer.mapper.localisation, self._poses)

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
        self.recorder.log_pose(motion.time, motion.T_odom_base)
        self._poses.append(Pose(motion.time, motion.T_odom_base, motion.T_odom_base))
        if self.explorer.steps:
            link = {(MAP, ODOM): self.explorer.mapper.localisation.T_map_odom}
            self._node.send("/tf", motion.time, transforms(motion.time, link))
        if self._interrupted():
            raise InterruptedDriveError

    def _add_keyframe(self, keyframe: Keyframe) -> None:
        frame = keyframe.frame
        self.trajectory.add(Pose(frame.time, frame.T_odom_base, frame.T_odom_base))
        self._maps.keyframe(keyframe)

    def _add(self, step: Step) -> None:
        self._frontiers = len(step.frontiers)
        self._maps.maps(self.explorer.mapper, step.keyframe, step.plan)

    def _time(self) -> float:
        return self.robot.time

    def _figures(self) -> dict[str, Any]:
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
