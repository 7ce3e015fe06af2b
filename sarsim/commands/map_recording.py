"""Map a recording (a TUM RGB-D folder, a ROS bag or a scene): ``map_recording.py PATH --out DIR``."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError, require_package
from pipeline.files import check_folder
from sarsim.commands.cli import exit_by_signal, is_verbose, run_watched
from sarsim.commands.settings import run_with_settings, save_settings
from sarsim.commands.tables import show_results
from sarsim.settings import MapRecordingConfig

if TYPE_CHECKING:
    from pipeline.datasets.recording import Recording

HDF5_MAGIC = b"\x89HDF"  # First bytes of a scene file


def map_recording(config: MapRecordingConfig) -> None:
    """Build all maps, a Rerun recording and a report from recorded camera frames.

    If the recording is damaged or a frame cannot be localised, the maps of the earlier frames are kept.
    """
    check_folder(config.out)
    from sarsim.commands.recorded_drive import RecordedDrive

    recording = open_recording(config)
    set_sensor(recording, config)
    drive = RecordedDrive(recording, config)
    try:
        ended_by = run_watched(drive.run, config.path.name)
    finally:
        if drive.report:
            save_settings(config, config.out / "config.yaml")
    if drive.report:
        show_results(drive.report, config.out, is_verbose())
    if drive.error:
        raise InputError(drive.error)
    exit_by_signal(ended_by)


def open_recording(config: MapRecordingConfig) -> "Recording":
    """The recording that ``config.path`` names; InputError if the recording does not exist or is broken."""
    from pipeline.datasets.image_pairs import holds_images
    from pipeline.datasets.recording import holds_bag
    from pipeline.datasets.tum_folder import read_tum_folder
    from pipeline.frame import Calibration
    from sarsim.dataset.scene_file import read_scene

    path, calibration = config.path, config.intrinsics and Calibration(*config.intrinsics)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if calibration and min(calibration) <= 0:
        raise InputError(f"--intrinsics {' '.join(map(str, calibration))}: all four values must be positive")
    is_scene = _is_scene(path)
    is_bag = not is_scene and (not path.is_dir() or (not holds_images(path) and holds_bag(path)))
    if is_scene:
        return _note_unused_flags(read_scene(path), config, "a scene", "topics", "intrinsics", "depth_scale", "fps")
    if is_bag:
        require_package("rosbags", "bags", f"{path}: reading a ROS bag")
        from pipeline.datasets.ros_bag import read_ros_bag

        recording = read_ros_bag(path, config.topics, calibration, config=config.io.datasets)
        return _note_unused_flags(recording, config, "a bag", "depth_scale", "fps")
    for flag, value in (("depth-scale", config.depth_scale), ("fps", config.fps)):
        if value is not None and not 0 < value < 1e6:
            raise InputError(f"--{flag} {value}: must be above 0 and below 1,000,000")
    recording = read_tum_folder(path, calibration, config.depth_scale, config.fps, config=config.io.datasets)
    if holds_bag(path):
        recording.note("the folder also contains a ROS bag, which is ignored; to map the bag, give its path")
    return _note_unused_flags(recording, config, "a folder of images", "topics")


def set_sensor(recording: "Recording", config: MapRecordingConfig) -> None:
    """Set the recording's camera from the flags and, if it names no camera, from the robot's file or the defaults.

    The robot's file also gives the range in sarsim's own recordings, except scenes, which always have the Xtion's.

    Raises:
        InputError: the flags give a range or noise that no camera can have.
    """
    from pipeline.datasets.depth_cameras import DEFAULT_SENSOR, with_overrides
    from pipeline.sensor import XTION
    from sarsim.robots.model import robot_sensor

    is_own = recording.sensor is XTION and not _is_scene(recording.path)
    if is_own and (own := robot_sensor(config.robot)) is not None:
        recording.sensor = own
        if config.depth_range is None:
            depths = f"depths from {own.nearest:g} to {own.farthest:g} m"
            recording.note(f"using {depths}, as in the file of --robot; to change them, use --depth-range")
    if recording.sensor is None:
        recording.sensor = robot_sensor(config.robot) or DEFAULT_SENSOR
        if config.depth_range is None:
            depths = f"depths from {recording.sensor.nearest:g} to {recording.sensor.farthest:g} m"
            recording.note(
                f"the recording does not name its camera; using {depths}; to change them, use --depth-range"
            )
    recording.sensor = with_overrides(recording.sensor, config.depth_range, config.depth_noise)


def _is_scene(path: Path) -> bool:
    """Whether a path is that of a dataset's scene."""
    return path.suffix == ".h5" or (path.is_file() and path.open("rb").read(len(HDF5_MAGIC)) == HDF5_MAGIC)


def _note_unused_flags(recording: "Recording", config: MapRecordingConfig, kind: str, *useless: str) -> "Recording":
    """Add a note about any of the ``useless`` flags that were given to a recording of this kind, and return it."""
    if given := [f"--{name.replace('_', '-')}" for name in useless if getattr(config, name)]:
        recording.note(f"ignoring {' and '.join(given)}, which {kind} does not need")
    return recording


def main() -> None:
    """Entry point of ``sarsim-map-recording``."""
    run_with_settings(map_recording, MapRecordingConfig)
