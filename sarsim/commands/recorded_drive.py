"""A run that maps a recording and writes the files of an episode."""

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from pipeline.arrays import Pose
from pipeline.datasets.recording import CameraPose, Recording
from pipeline.datasets.replay import Replay, Replayed, default_pose_source, localisation_of
from pipeline.errors import InputError
from pipeline.localisation.localisation import LostError
from pipeline.progress import Progress
from pipeline.run import MappingRun
from pipeline.sensor import XTION
from pipeline.sink import Result, Sink
from pipeline.transforms import inverse
from sarsim.composition import compose, make_mapper
from sarsim.methods.plugins import make_plugins
from sarsim.robots.model import robot_model
from sarsim.robots.pose import TrajectorySample
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import MapRecordingConfig

_log = logging.getLogger(__name__)


def camera_pose(recording: Recording, config: MapRecordingConfig) -> Pose | None:
    """The camera's 4×4 pose on the robot from ``--camera-pose``, completed from the recording; None without the flag.

    Raises:
        InputError: a number is not finite, or the recording lacks the pose that completes the given one.
    """
    if config.camera_pose is None:
        return None
    given = {name: x for name, x in zip(CameraPose._fields, config.camera_pose, strict=True) if x is not None}
    words = f"--camera-pose {' '.join('None' if x is None else f'{x:g}' for x in config.camera_pose)}"
    if not np.isfinite(list(given.values())).all():
        raise InputError(f"{words}: all numbers must be finite")
    if len(given) == len(CameraPose._fields):
        return CameraPose(**given).T_base_camera
    if not recording.has_camera_pose:
        raise InputError(f"{words}: {recording.path} lacks the camera's pose; give all six numbers")
    left_out = dict(recording.left_out)
    first = next(recording.frames(), None)
    recording.left_out = left_out  # The frames skipped here will be counted when the recording is mapped
    return None if first is None else CameraPose.of(first.T_base_camera)._replace(**given).T_base_camera


class _Score(Sink):
    """Adds the errors of the trajectory to the report, if the recording has true poses."""

    def __init__(self, score: TrajectoryScore):
        self._score = score

    def finish(self, result: Result) -> None:
        """Add the errors to the report, if there are true poses."""
        if self._score.has_truth:
            result.add({"localisation": self._score.report()})


class RecordedDrive(MappingRun):
    """A run that maps a recording and writes the results.

    Attributes:
        frames: number of frames processed so far.
        error: reason why the recording could not be mapped to its end; empty otherwise.
    """

    def __init__(self, recording: Recording, config: MapRecordingConfig):
        """Prepare the run; InputError if the recording lacks the requested poses, or the folder cannot be written."""
        self.recording, self.config = recording, config
        poses, model = config.poses or default_pose_source(recording), robot_model(config.robot)
        plugins = make_plugins(config)
        localisation = localisation_of(poses, config.pipeline.localisation)
        sensor = recording.sensor or XTION
        mapper = make_mapper(config, model, localisation=localisation, plugins=plugins, sensor=sensor)
        camera = camera_pose(recording, config)
        self._replay = Replay(recording, mapper, poses, camera)
        self.frames, self.error = 0, ""
        self._poses: list[TrajectorySample] = []
        self._score, self._T_map_world = TrajectoryScore(mapper.localisation, self._poses), np.eye(4)
        self._score.has_truth, self._score.is_recorded = False, True
        others = [_Score(self._score)]
        super().__init__(compose(config, mapper, config.out, config.path.name, others=others, plugins=plugins))

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_progress: Callable[[Progress], object] = lambda progress: None,
    ) -> None:
        """Map until the recording ends or proves broken, or ``interrupted`` returns True; then write the results."""
        self._watch = on_progress
        self.start_clock()
        try:
            for replayed in self._replay:
                self._add(replayed)
                on_progress(
                    Progress(
                        f"{self.parts.place_name}: {len(self.mapper.keyframes)} keyframes from {self.frames} frames"
                    )
                )
                if interrupted():
                    break
        except (InputError, LostError) as error:
            self.error = str(error)
        finally:  # also after an error in a user's own class
            if self.labelled:
                self._write()
            else:
                self._remove_unfinished()

    def _add(self, replayed: Replayed) -> None:
        frame, keyframe, truth = replayed
        T = frame.T_odom_base
        if truth is not None and not self._score.has_truth:
            # The transform from the true poses' frame to the map is unknown, so the first true pose is made to
            # coincide with the estimate.
            self._score.has_truth, self._T_map_world = True, self.mapper.T_map_odom @ T @ inverse(truth)
        self.frames += 1
        true = np.full((4, 4), np.nan) if truth is None else self._T_map_world @ truth
        self._poses.append(TrajectorySample(frame.time, true, T))
        if keyframe is None:
            self.recorder.log_pose(frame.time, T)
            return
        self._score.add()
        if len(keyframe.labels):
            self.show(keyframe)

    def _write(self) -> None:
        if self.recording.left_out:
            _log.warning("%s: skipped %s", self.recording.path, self._left_out())
        sim_time = self._poses[-1].time - self._poses[0].time
        self.finish(self._score, len(self.labelled), sim_time, self._figures())

    def _remove_unfinished(self) -> None:
        """Remove the files that were started, because no frame could be used."""
        self.recorder.close()
        (self.parts.folder / "episode.rrd").unlink()
        with suppress(OSError):  # the folder holds earlier results
            self.parts.folder.rmdir()
        if not self.error:
            skipped = self._left_out()
            found = f"no usable frames; skipped {skipped}" if skipped else "no frames"
            self.error = f"{self.recording.path}: contains {found}"

    def _left_out(self) -> str:
        return ", ".join(f"{count} {reason}" for reason, count in self.recording.left_out.items())

    def _figures(self) -> dict[str, Any]:
        return {
            "recording": {
                "frames": self.frames,
                "keyframes": len(self.mapper.keyframes),
                "loops": len(self.mapper.localisation.loops),
                "left_out": self.recording.left_out,
                **({"notes": self.recording.notes} if self.recording.notes else {}),
                **({"stopped": self.error} if self.error else {}),
            }
        }
