"""A labelled lidar as a plug-in, ``--lidar SENSOR``; the robot's own maps use only its camera."""

import shutil
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from pipeline.arrays import Pose
from pipeline.errors import InputError, required
from pipeline.frame import Frame
from pipeline.labels import COLOURS
from pipeline.mapper import Mapper
from pipeline.plugin import Plugin, RunContext
from pipeline.rerun.recorder import Recorder
from pipeline.robot import Motion, Robot, Velocity
from pipeline.sink import Result, Sink, Step
from sarsim.dataset.settings import DatasetConfig
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.lidar.scanner import Scan, Scanner
from sarsim.plugins.lidar.semantic_kitti import SequenceWriter, sequence_folder, write_label_table
from sarsim.settings import SimulatorConfig, TeleopConfig

STREAM = 0x11DA2  # part of the lidar's seed, so that its random numbers differ from others of the same seed
MAX_UNSENT = 64
"""Maximum number of scans that wait to be sent; without a limit, they would accumulate if nothing fetches them."""
ENTITY = "world/robot/lidar"


class Lidar(Plugin):
    """Puts a lidar on the simulated robot, and writes, shows and sends its scans."""

    Settings = LidarConfig

    def __init__(self, settings: LidarConfig, command: Any) -> None:
        super().__init__(settings, command)
        if not isinstance(command, SimulatorConfig | TeleopConfig | DatasetConfig):
            raise InputError("--lidar: only a simulated robot has this lidar; leave it out")
        self._robot: ScanningRobot | None = None

    def _scanner(self, model: Any, data: Any, base_body: int, *seed: int) -> Scanner:
        settings: LidarConfig = self.settings
        rng = np.random.default_rng([*seed, STREAM]) if settings.noise else None
        return Scanner(model, data, base_body, settings.model(), rng, settings.rolling)

    def wrap(self, robot: Robot, world: Any, mapper: Mapper | None) -> Robot:
        """The robot, with the lidar on it."""
        physics, seed = world.physics, getattr(self.command, "seed", 0)
        self._robot = ScanningRobot(robot, self._scanner(physics.model.ptr, physics.data.ptr, world.base_body, seed))
        return self._robot

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """The sink that writes the scans, and shows one at every step."""
        robot = required(self._robot)
        return [ScanFiles(robot, required(context.folder), context.recorder)]

    def measurements(self) -> Iterable[tuple[str, float, Any]]:
        """Yield the messages of all scans since the last call."""
        from sarsim.plugins.lidar.ros import scan_messages  # needs a package of its own

        robot = required(self._robot)
        while robot.unsent:
            yield from scan_messages(robot.unsent.popleft(), robot.scanner.model, robot.scanner.T_base_lidar)

    @contextmanager
    def scene(self, world: Any, folder: Path, index: int) -> Iterator[Callable[[Any], object]]:
        """Write a sequence with a scan at every frame's pose, as if the robot stood still there."""
        scanner = self._scanner(world.model, world.data, world.camera.base_body, self.command.seed, index)
        writer = SequenceWriter(sequence_folder(folder, index))
        try:
            yield lambda pose: writer.add(scanner.scan(pose.time))
            writer.save()
        except BaseException:
            shutil.rmtree(sequence_folder(folder, index), ignore_errors=True)
            raise

    def dataset(self, folder: Path, splits: Mapping[int, str]) -> None:
        """Write the label table of all sequences."""
        write_label_table(folder, splits)


class ScanningRobot:
    """A robot with a lidar, which scans from the camera's first frame onwards.

    Attributes:
        model, control_period: the robot's dimensions and abilities, and its control period, s.
        scanner: the lidar.
        listeners: called with each scan.
        unsent: the newest scans, for a bag or a network.
    """

    def __init__(self, robot: Robot, scanner: Scanner):
        self.model, self.control_period = robot.model, robot.control_period
        self._robot, self.scanner = robot, scanner
        self.listeners: list[Callable[[Scan], object]] = []
        self.unsent: deque[Scan] = deque(maxlen=MAX_UNSENT)

    def sense(self) -> Frame:
        """Take a frame of the camera at the robot's current pose."""
        frame = self._robot.sense()
        self._advance(frame.time)
        return frame

    def drive(self, command: Velocity) -> Motion:
        """Follow ``command`` for one control period, and scan."""
        motion = self._robot.drive(command)
        self._advance(motion.time)
        return motion

    def _advance(self, time: float) -> None:
        for scan in self.scanner.advance(time):
            self.unsent.append(scan)
            for listener in self.listeners:
                listener(scan)


class ScanFiles(Sink):
    """Writes the scans of a run, and logs the newest one at every step."""

    finishing = "writing the lidar's scans"

    def __init__(self, robot: ScanningRobot, folder: Path, recorder: Recorder | None):
        """Begin the sequence in the run's folder; InputError if it cannot be written."""
        self._robot, self._folder, self._recorder = robot, folder, recorder
        self._writer = SequenceWriter(sequence_folder(folder, 0))
        self._newest: Scan | None = None
        robot.listeners.append(self._take)

    def _take(self, scan: Scan) -> None:
        self._newest = scan
        self._writer.add(scan)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Log the newest scan, with points in the colours of their labels."""
        if self._recorder is not None and self._newest is not None:
            log_scan(self._recorder.stream, self._newest, self._robot.scanner.T_base_lidar)

    def figures(self) -> dict[str, Any]:
        """The numbers of scans and points so far."""
        return {"lidar": {"scans": self._writer.scans, "points": self._writer.points}}

    def finish(self, result: Result) -> None:
        """Complete the sequence; InputError if it cannot be written."""
        super().finish(result)
        self._writer.save()
        write_label_table(self._folder, {0: "train"})


def log_scan(stream: rr.RecordingStream, scan: Scan, T_base_lidar: Pose) -> None:
    """Log a scan on the robot to Rerun."""
    place = rr.Transform3D(translation=T_base_lidar[:3, 3], mat3x3=T_base_lidar[:3, :3])
    points = rr.Points3D(scan.points, colors=COLOURS[scan.label], radii=rr.Radius.ui_points(1.5))
    stream.log(ENTITY, place, points)
