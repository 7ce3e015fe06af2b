"""Maps a recording, and writes the files of an episode."""

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from pipeline.datasets.recording import CameraPose, Recording
from pipeline.datasets.replay import Replay, Replayed, default_poses, localisation_of
from pipeline.errors import InputError
from pipeline.localisation.localisation import LostError
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.report import write_page
from pipeline.rescue_report.situation import situation_of
from pipeline.results import save_maps
from pipeline.transforms import inverse
from pipeline.victims.detection.detector import VictimDetector
from sarsim.episode import make_classifier, make_folder, run_report, write_report
from sarsim.robots.pose import Pose
from sarsim.robots.skid_steered import robot_model
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import MapRecording

RECORDING = "episode.rrd"  # The file for Rerun's viewer


class RecordedDrive:
    """A recording, a mapper, and the recorder and score that observe them.

    Attributes:
        mapper: all maps.
        frames: number of frames so far.
        report: the content of report.json; empty if no frame was mapped.
        error: why the recording could not be mapped to its end; empty otherwise.
    """

    def __init__(self, recording: Recording, config: MapRecording):
        """Raises InputError if the recording lacks the wanted poses, or the output folder cannot be written."""
        self.recording, self.config = recording, config
        detector = VictimDetector.load(*config.detector) if config.detector else None
        poses = config.poses or default_poses(recording)
        classifier, localisation = make_classifier(config.labels, config.weights), localisation_of(poses)
        self._robot = robot_model(config.robot)
        self.mapper = Mapper(self._robot, classifier, detector, localisation=localisation)
        camera = config.camera and CameraPose(*config.camera).T_base_camera
        self._replay = Replay(recording, self.mapper, poses, camera)
        make_folder(config.out)
        self._recorder = Recorder(config.out / RECORDING)
        self.frames, self._labelled, self.error = 0, list[int](), ""
        self.report: dict[str, Any] = {}
        self._trajectory: list[Pose] = []
        self._score = TrajectoryScore(localisation, self._trajectory)
        self._has_truth, self._T_map_world = False, np.eye(4)

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_frame: Callable[[str], object] = lambda description: None,
    ) -> None:
        """Map until the recording ends, breaks, or is ``interrupted``, and write the results."""
        start = perf_counter()
        try:
            for replayed in self._replay:
                self._add(replayed)
                on_frame(f"{self.config.path.name}: {len(self.mapper.keyframes)} keyframes")
                if interrupted():
                    break
        except (InputError, LostError) as error:
            self.error = str(error)
        if self._labelled:
            self.mapper.settle()
            self.report = self._report(perf_counter() - start)
        self._recorder.close()
        if self._labelled:
            self._write()
            return
        (self.config.out / RECORDING).unlink()
        if not self.error:
            left_out = ", ".join(f"{count} {reason}" for reason, count in self.recording.left_out.items())
            self.error = f"{self.recording.path}: holds no frame that could be used; {left_out or 'it is empty'}"

    def _add(self, replayed: Replayed) -> None:
        frame, keyframe, truth = replayed
        T = frame.T_odom_base
        if not self.frames and truth is not None:
            # The pose of the true poses' frame in the map is unknown, so the first poses are made to coincide.
            self._has_truth, self._T_map_world = True, T @ inverse(truth)
        self.frames += 1
        if truth is not None or not self._has_truth:
            self._trajectory.append(Pose(frame.time, T if truth is None else self._T_map_world @ truth, T))
        if keyframe is None:
            self._recorder.log_pose(frame.time, T)
            return
        self._score.add()
        if len(keyframe.labels):
            self._recorder.log_keyframe(len(self._labelled), self.mapper, keyframe)
            self._labelled.append(keyframe.index)

    def _report(self, wall_time: float) -> dict[str, Any]:
        sim_time = self._trajectory[-1].time - self._trajectory[0].time
        return {
            "arena": self.config.path.name,
            "seed": 0,
            "steps": len(self._labelled),
            **run_report(self.config, self.config.out, sim_time, wall_time, self.mapper),
            "recording": {
                "frames": self.frames,
                "keyframes": len(self.mapper.keyframes),
                "loops": len(self.mapper.localisation.loops),
                "left_out": self.recording.left_out,
                **({"stopped": self.error} if self.error else {}),
            },
            **({"localisation": self._score.report()} if self._has_truth else {}),
        }

    def _write(self) -> None:
        out, mapper = self.config.out, self.mapper
        write_report(self.report, out)
        save_maps(mapper, out)
        self._score.save(out, with_truth=self._has_truth)
        poses = mapper.keyframes.poses[self._labelled]
        height = float(mapper.keyframes.seen[self._labelled[0]].T_base_camera[2, 3])
        situation = situation_of(mapper, self._robot, poses, height, finished=not self.error)
        write_page(out / "report.html", situation, self.report)
