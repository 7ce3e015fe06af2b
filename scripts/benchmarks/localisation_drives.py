"""Drives for the localisation benchmark: the robot's frames, wheel odometry and true poses.

The robot explores using its true pose, so that a drive does not depend on the method measured with it.
"""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.files import atomic_write
from pipeline.frame import Frame, Intrinsics
from pipeline.grid_map import Grid
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.robot import Motion
from pipeline.sink import Sink
from pipeline.transforms import inverse
from sarsim.arenas.load import load_arena
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.dataset.hdf5 import FAST, NewFile, open_file, write_noisy
from sarsim.dataset.scene_file import PER_METRE
from sarsim.ground_truth.true_surface import GroundTruthSurface, Survey
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.episodes import Job, leave

SPACING, TURN = 0.1, np.deg2rad(5)  # m and rad between frames
JPEG_QUALITY = 95  # Of colour images; lossless compression hardly shrinks their noise
_GROUND = ("height", "drivable", "walls")  # Layers of the true ground stored in a file


@dataclass(frozen=True)
class DriveJob(Job):
    """A drive to record.

    Attributes:
        frames: maximum number of frames of the drive.
    """

    frames: int

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that the drive depends on; networks are left out, as they do not influence it."""
        content = super().settings
        config = {
            name: value for name, value in content["config"].items() if name not in ("weights", "detector", "out")
        }
        return content | {"config": config, "frames": self.frames}


class DriveWriter(ExitStack):
    """Writes a drive to a file, frame by frame."""

    def __init__(self, path: Path, settings: dict[str, Any], surface: GroundTruthSurface):
        """Create the file; OSError, here or later, if it cannot be written."""
        super().__init__()
        self._new = self.enter_context(NewFile(path))
        self._file = self._new.file
        self._rows: dict[str, list[Any]] = {"time": [], "T_world_base": [], "T_odom_base": [], "T_base_camera": []}
        self._file.attrs.update(settings=json.dumps(settings), low=surface.grid.low, cell=surface.grid.cell)
        for name in _GROUND:
            self._file.create_dataset(f"ground/{name}", data=getattr(surface, name), **FAST)
        self.callback(self._write_rows)

    def __len__(self) -> int:
        return len(self._rows["time"])

    def write(self, frame: Frame, T_world_base: Pose) -> None:
        """Add the next frame with its true pose."""
        self._new.check()
        if not len(self):
            self._make_images(frame.intrinsics)
        index = len(self)
        for name in ("rgb", "depth"):
            self._file[name].resize(index + 1, axis=0)
        bgr = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2BGR)
        self._file["rgb"][index] = cv2.imencode(".jpg", bgr, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1].ravel()
        write_noisy(self._file["depth"], index, np.rint(frame.depth * PER_METRE).astype(np.uint16))
        row = (frame.time, T_world_base, frame.T_odom_base, frame.T_base_camera)
        for column, value in zip(self._rows.values(), row, strict=True):
            column.append(value)

    def _make_images(self, k: Intrinsics) -> None:
        shape = (k.height, k.width)
        self._file["intrinsics"] = [k.fx, k.fy, k.cx, k.cy]
        self._file.create_dataset("rgb", (0,), h5py.vlen_dtype(np.uint8), maxshape=(None,))
        filters = FAST | {"shuffle": True, "chunks": (1, *shape), "maxshape": (None, *shape)}
        self._file.create_dataset("depth", (0, *shape), np.uint16, **filters)

    def _write_rows(self) -> None:
        for name, values in self._rows.items():
            self._file[name] = np.array(values)


class DriveReader(ExitStack):
    """Reads a drive from a file; iteration yields its frames, with ``T_odom_base`` from wheels and gyro.

    Attributes:
        settings: settings of the job that recorded the drive.
        time: (N,) times of the frames, s.
        T_world_base: (N, 4, 4) true poses; the ``odom`` and world frames coincide at the start.
        T_odom_base: (N, 4, 4) odometry poses from wheels and gyro.
        surface: the true ground.
    """

    def __init__(self, path: Path):
        """Open a file; InputError if it is missing or broken."""
        super().__init__()
        file = self._file = self.enter_context(open_file(path))
        try:
            self.settings: dict[str, Any] = json.loads(file.attrs["settings"])
            self.time, self.T_world_base = file["time"][:], file["T_world_base"][:]
            self.T_odom_base, self._T_base_camera = file["T_odom_base"][:], file["T_base_camera"][:]
            height, drivable, walls = (file[f"ground/{name}"][:] for name in _GROUND)
            grid = Grid(file.attrs["low"], float(file.attrs["cell"]), height.shape)
            self.surface = GroundTruthSurface(grid, height, drivable, walls)
            self._intrinsics = Intrinsics(*file["depth"].shape[:0:-1], *map(float, file["intrinsics"]))
        except (KeyError, ValueError, OSError, RuntimeError) as error:
            self.close()
            raise InputError(
                f"{path}: not a recorded drive ({' '.join(str(error).split())});"
                f" delete it and {path.stem}.json to record the drive again"
            ) from error

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[Frame]:
        return map(self.frame, range(len(self)))

    def frame(self, index: int) -> Frame:
        """One frame, without labels."""
        bgr: Any = cv2.imdecode(self._file["rgb"][index], cv2.IMREAD_COLOR)
        return Frame(
            time=float(self.time[index]),
            rgb=bgr[..., ::-1].copy(),
            depth=np.asarray(self._file["depth"][index] / PER_METRE, np.float32),
            intrinsics=self._intrinsics,
            T_base_camera=self._T_base_camera[index],
            T_odom_base=self.T_odom_base[index],
        )


def drive_file(job: Job, folder: Path) -> Path:
    """Path of the file with a job's drive."""
    return folder / f"{job.name}.h5"


def record_job(job: DriveJob, folder: Path) -> None:
    """Explore using the true pose; write the drive to a folder, and a JSON file that marks it as complete."""

    def made() -> dict[str, Any]:
        try:
            return {"frames": _record(job, drive_file(job, folder))}
        except InputError as error:
            return {"left_out": str(error)}

    leave(job, folder, made)


def _record(job: DriveJob, path: Path) -> int:
    """Record a drive and return its number of frames."""
    config = job.config
    simulation = SimulationConfig("truth", config.sensor, config.lighting, config.dust, config.speed)
    robot = SimulatedRobot(load_arena(config.arena), simulation, config.seed)
    survey = Survey(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body, robot.model)
    surface = survey.surface_from(robot.trajectory[-1].T_world_base[:3, 3])
    with atomic_write(path) as partial, DriveWriter(partial, job.settings, surface) as writer:
        recorder = _Recorder(robot, writer)
        mapper = make_mapper(TRUE_LABELS, robot.model, config.seed, OdometryLocalisation())
        explorer = Explorer(robot, mapper)
        explorer.watch(recorder)
        step = explorer.step()
        recorder.take(step.keyframe.frame)
        while step.plan is not None and explorer.steps < config.most_steps and len(writer) < job.frames:
            explorer.drive(step)
            step = explorer.step()
            recorder.take(step.keyframe.frame)
    robot.close()
    return len(writer)


class _Recorder(Sink):
    """Takes a frame whenever the robot has moved ``SPACING`` or turned ``TURN`` since the last one."""

    def __init__(self, robot: SimulatedRobot, writer: DriveWriter):
        self._robot, self._writer = robot, writer
        self._last = robot.trajectory[-1]

    def on_motion(self, motion: Motion) -> None:
        """Take a frame if the robot has moved or turned far enough."""
        moved = inverse(self._last.T_world_base) @ self._robot.trajectory[-1].T_world_base
        turned = Rotation.from_matrix(moved[:3, :3]).magnitude()
        if np.linalg.norm(moved[:3, 3]) >= SPACING or turned >= TURN:
            self.take(self._robot.sense())

    def take(self, frame: Frame) -> None:
        """Write a frame with its wheel odometry, unless it has been written already or the robot has moved since.

        A robot that plans while rolling may have come to rest after the frame was taken.
        """
        pose = self._robot.trajectory[-1]
        if pose.time == frame.time and (pose.time > self._last.time or not len(self._writer)):
            self._writer.write(replace(frame, T_odom_base=self._robot.T_wheel_base), pose.T_world_base)
            self._last = pose
