"""Maps a recording, and writes the files of an episode."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from pipeline.datasets.recording import CameraPose, Recording
from pipeline.datasets.replay import Replay, Replayed, default_poses, localisation_of
from pipeline.errors import InputError
from pipeline.files import make_folder
from pipeline.league.brief import MissionBrief
from pipeline.localisation.localisation import LostError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.situation import Situation, situation_of
from pipeline.run import ResultFolder
from pipeline.transforms import inverse
from sarsim.methods.perception import make_perception, make_readers
from sarsim.robots.model import robot_model
from sarsim.robots.pose import Pose
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import MapRecording

RECORDING = "episode.rrd"  # The file for Rerun's viewer


class RecordedDrive:
    """A recording, a mapper, and the results of a run through both.

    Attributes:
        mapper: all maps.
        frames: number of frames so far.
        error: why the recording could not be mapped to its end; empty otherwise.
    """

    def __init__(self, recording: Recording, config: MapRecording, brief: MissionBrief | None = None):
        """Raises InputError if the recording lacks the wanted poses, or the output folder cannot be written."""
        self.recording, self.config = recording, config
        poses = config.poses or default_poses(recording)
        (classifier, detector), localisation = make_perception(config), localisation_of(poses)
        self._robot = robot_model(config.robot)
        self.mapper = Mapper(
            self._robot, classifier, detector, localisation=localisation, readers=make_readers(config)
        )
        camera = config.camera and CameraPose(*config.camera).T_base_camera
        self._replay = Replay(recording, self.mapper, poses, camera)
        make_folder(config.out)
        self._recorder = Recorder(config.out / RECORDING)
        self._results = ResultFolder(config, config.out, config.path.name, 0, self.mapper, self._recorder, brief)
        self.frames, self._labelled, self.error = 0, list[int](), ""
        self._poses: list[Pose] = []
        self._score = TrajectoryScore(localisation, self._poses)
        self._has_truth, self._T_map_world = False, np.eye(4)

    @property
    def report(self) -> dict[str, Any]:
        """The content of report.json; empty if no frame was mapped."""
        return self._results.report

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_frame: Callable[[str], object] = lambda description: None,
    ) -> None:
        """Map until the recording ends, breaks, or is ``interrupted``, and write the results."""
        begin = perf_counter()
        try:
            for replayed in self._replay:
                self._add(replayed)
                on_frame(f"{self.config.path.name}: {len(self.mapper.keyframes)} keyframes")
                if interrupted():
                    break
        except (InputError, LostError) as error:
            self.error = str(error)
        self._finish(perf_counter() - begin)

    def _add(self, replayed: Replayed) -> None:
        frame, keyframe, truth = replayed
        T = frame.T_odom_base
        if not self.frames and truth is not None:
            # The pose of the true poses' frame in the map is unknown, so the first poses are made to coincide.
            self._has_truth, self._T_map_world = True, T @ inverse(truth)
        self.frames += 1
        if truth is not None or not self._has_truth:
            self._poses.append(Pose(frame.time, T if truth is None else self._T_map_world @ truth, T))
        if keyframe is None:
            self._recorder.log_pose(frame.time, T)
            return
        self._score.add()
        if len(keyframe.labels):
            self._recorder.log_keyframe(len(self._labelled), self.mapper, keyframe)
            self._labelled.append(keyframe.index)

    def _finish(self, wall_time: float) -> None:
        """Write the results of a run of ``wall_time`` s."""
        if self._labelled:
            score, close = self._score, [self._recorder.close]
            save = score.save if self._has_truth else partial(EstimatedTrajectory.save, score)
            report = partial(self._write_report, wall_time)
            self._results.write(self.mapper.settle, save, self._situation, close, report)
            return
        self._recorder.close()
        (self.config.out / RECORDING).unlink()
        with suppress(OSError):  # it holds earlier results
            self.config.out.rmdir()
        if not self.error:
            left_out = ", ".join(f"{count} {reason}" for reason, count in self.recording.left_out.items())
            self.error = f"{self.recording.path}: holds no frame that could be used; {left_out or 'it is empty'}"

    def _situation(self) -> Situation:
        height = float(self.mapper.keyframes.seen[self._labelled[0]].T_base_camera[2, 3])
        return situation_of(self.mapper, self._robot, height, finished=not self.error)

    def _write_report(self, wall_time: float) -> None:
        figures: dict[str, Any] = {
            "recording": {
                "frames": self.frames,
                "keyframes": len(self.mapper.keyframes),
                "loops": len(self.mapper.localisation.loops),
                "left_out": self.recording.left_out,
                **({"stopped": self.error} if self.error else {}),
            }
        }
        if self._has_truth:
            figures["localisation"] = self._score.report()
        sim_time = self._poses[-1].time - self._poses[0].time
        self._results.write_report(len(self._labelled), sim_time, wall_time, figures)
