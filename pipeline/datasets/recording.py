"""A recording: frames, the known poses at which they were taken, and other recorded data."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.arrays import Direction, Pose
from pipeline.datasets.depth_cameras import camera_named
from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.frame import Frame
from pipeline.localisation.trajectory import Trajectory
from pipeline.sensor import SensorModel
from pipeline.transforms import from_rotation

BAG_ENDINGS = ".mcap", ".db3", ".bag"  # Endings of files with ROS messages
_log = logging.getLogger(__name__)


class CameraPose(NamedTuple):
    """Pose of a camera in ``base_link``, m and degrees; with angles of 0, the camera is level and looks forward."""

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float

    @classmethod
    def of(cls, T_base_camera: Pose) -> Self:
        """The position and angles of a pose of ``camera_optical``."""
        R = Rotation.from_matrix(T_base_camera[:3, :3] @ LINK_OPTICAL.T)
        yaw, pitch, roll = R.as_euler("ZYX", degrees=True).tolist()
        x, y, z = T_base_camera[:3, 3].tolist()
        return cls(x, y, z, roll, pitch, yaw)

    @property
    def T_base_camera(self) -> Pose:
        """Pose of ``camera_optical``; as in REP 103, the pitch of a camera that looks down is positive."""
        R = Rotation.from_euler("ZYX", [self.yaw, self.pitch, self.roll], degrees=True).as_matrix()
        return from_rotation(R @ LINK_OPTICAL, [self.x, self.y, self.z])


LINK_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation of ``camera_optical`` in the frame of a camera body that looks along its x axis (REP 103)."""


@dataclass(eq=False)
class Recording:
    """Frames of an RGB-D camera, and other data recorded with them.

    Attributes:
        path: file or folder of the recording.
        frames: returns an iterator over the frames in chronological order. Their ``T_odom_base`` is the identity, and
            so is ``T_base_camera`` if it is unknown. The iterator raises InputError at the point where the recording
            is broken; the frames before this point are usable.
        has_camera_pose: whether the frames contain the camera's pose on the robot.
        odometry: recorded poses in ``odom``, of ``base_link`` or of the camera; None if there are none.
        truth: true poses for comparison, in any frame.
        up: the vertical at the start, measured by an accelerometer, in ``base_link``; in ``camera_optical`` if the
            camera's pose is unknown.
        keyframes: times of the frames that became keyframes during the recording, s, and whether the robot labelled
            each keyframe; None if unknown.
        steps: times of the keyframes at which the robot stopped, corrected its maps and planned, s.
        sensor: range and noise of the camera that the recording names; None if it names no known camera.
        left_out: number of items that could not be used, by reason.
        notes: assumptions made where the recording is not as expected, one line each.
    """

    path: Path
    frames: Callable[[], Iterator[Frame]]
    has_camera_pose: bool = False
    odometry: Trajectory | None = None
    truth: Trajectory | None = None
    up: Direction | None = None
    keyframes: Mapping[float, bool] | None = None
    steps: Set[float] = frozenset()
    sensor: SensorModel | None = None
    left_out: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def note(self, line: str) -> None:
        """Store a line about an assumption, and warn the user with it, unless this line was already stored."""
        if line not in self.notes:
            self.notes.append(line)
            _log.warning("%s: %s", self.path, line)

    def take_sensor(self, names: Iterable[str]) -> None:
        """Use and note the range and noise of the known camera, if any, that one of the names identifies."""
        found = camera_named(names)
        if found is None:
            return
        camera, name = found
        self.sensor = camera.sensor
        depths = f"depths from {camera.sensor.nearest:g} to {camera.sensor.farthest:g} m"
        self.note(f"using {depths}, as for {camera.name} (named in {name}); to change them, use --depth-range")

    def leave_out(self, reason: str) -> None:
        """Count an item that cannot be used."""
        self.left_out[reason] = self.left_out.get(reason, 0) + 1

    def check_clocks(self, first: float, last: float) -> None:
        """Raise InputError if known poses do not overlap in time with the images.

        ``first``, ``last``: times of the first and of the last image, s.
        """
        for name, poses in (("odometry", self.odometry), ("true poses", self.truth)):
            if poses is not None and (poses.times[0] > last or poses.times[-1] < first):
                of_poses = f"{name} from {poses.times[0]:.2f} to {poses.times[-1]:.2f} s"
                spans = f"images from {first:.2f} to {last:.2f} s, {of_poses}"
                raise InputError(f"{self.path}: timestamps do not overlap: {spans}; correct or remove the {name}")


def holds_bag(path: Path) -> bool:
    """Whether a folder is a bag or contains at least one bag."""
    return any(file.suffix in BAG_ENDINGS for file in path.iterdir()) or describes_bag(path / "metadata.yaml")


def describes_bag(file: Path) -> bool:
    """Whether a file, which may be missing, describes a bag of ROS 2."""
    return file.is_file() and "rosbag2_bagfile_information" in read_text(file)
