"""Map what was recorded, a TUM RGB-D folder, a ROS bag or a scene: ``map_recording.py PATH --out DIR``."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from pipeline.errors import InputError
from sarsim.scripts.cli import INTERRUPTED, Interruptible, progress
from sarsim.scripts.settings import run_with_settings, save_settings
from sarsim.scripts.tables import report_table
from sarsim.settings import DETECTOR, WEIGHTS, Labels

if TYPE_CHECKING:
    from pipeline.recording.sources.recording import Recording

BAGS = (".mcap", ".db3", ".yaml", ".bag")
"""Endings of a bag's files."""


@dataclass(frozen=True)
class MapRecording:
    """What is mapped, and what the recording does not tell itself.

    Attributes:
        path: a TUM RGB-D folder, the folder or file of a ROS bag (MCAP, SQLite), or a scene's .h5 of a dataset.
        out: folder for the results, the same files as an episode's.
        poses: where they come from: recorded odometry, corrected by registration (slam), registration alone,
            recorded odometry or true poses taken at their word; by default slam if there is odometry.
        labels: what labels the points: the network, or true labels that a simulator recorded.
        weights: of the network, as train.py writes them.
        detector: of victims: Darknet's .cfg and .weights of a YOLOv3; None looks for no victims, which is faster.
        camera: of the camera on the robot: x y z in m, roll pitch yaw in degrees, pitch positive where it looks down;
            by default as the recording has it, else level over the floor of the first frame.
        intrinsics: of the camera, fx fy cx cy in pixels, pixel centres at whole numbers, as calibrations have them.
        depth_scale: of a folder's depth images, units a metre (5000).
        fps: frames per second of a folder whose images have no times.
        topics: of a bag, those to use where it has several of a kind.
    """

    path: Annotated[Path, tyro.conf.Positional]
    out: Path
    poses: Literal["slam", "registration", "odometry", "truth"] | None = None
    labels: Labels = "dgcnn"
    weights: Path = WEIGHTS
    detector: tuple[Path, Path] | None = DETECTOR if all(path.exists() for path in DETECTOR) else None
    camera: tuple[float, float, float, float, float, float] | None = None
    intrinsics: tuple[float, float, float, float] | None = None
    depth_scale: float | None = None
    fps: float | None = None
    topics: tuple[str, ...] = ()


def map_recording(config: MapRecording) -> None:
    """Make every map, a recording and a report of what a camera recorded.

    Where the recording is broken or nothing tells any more where a frame was taken, what came before is kept.
    """
    from sarsim.scripts.recorded_drive import RecordedDrive

    recording = open_recording(config)
    drive = RecordedDrive(recording, config)
    with progress() as bars, Interruptible() as control:
        bar = bars.add_task(config.path.name, total=None)
        drive.run(
            lambda: control.interrupted, lambda line: bars.update(bar, completed=drive.frames, description=line)
        )
    if drive.report:
        save_settings(config, config.out / "config.yaml")
        Console().print(report_table(drive.report))
        Console().print(f"Results in {config.out}", soft_wrap=True)
    if drive.error:
        raise InputError(drive.error)
    if control.interrupted:
        raise SystemExit(INTERRUPTED)


def open_recording(config: MapRecording) -> "Recording":
    """The recording that a path names.

    Raises:
        InputError: it is none, or broken.
    """
    from pipeline.recording.sources.recording import Calibration
    from pipeline.recording.sources.ros_bag import read_ros_bag
    from pipeline.recording.sources.tum_folder import read_tum_folder
    from sarsim.dataset.recorded_scene import read_scene

    path, calibration = config.path, config.intrinsics and Calibration(*config.intrinsics)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if calibration and min(calibration) <= 0:
        raise InputError(f"--intrinsics {' '.join(map(str, calibration))}: must be positive")
    if path.suffix == ".h5":
        return read_scene(path)
    if path.is_file() or any(file.suffix in BAGS for file in path.iterdir()):
        return read_ros_bag(path, config.topics, calibration)
    for flag, value in (("depth-scale", config.depth_scale), ("fps", config.fps)):
        if value is not None and not 0 < value < 1e6:
            raise InputError(f"--{flag} {value}: must be positive")
    return read_tum_folder(path, calibration, config.depth_scale, config.fps)


def main() -> None:
    """Entry point."""
    run_with_settings(map_recording, MapRecording)


if __name__ == "__main__":
    main()
