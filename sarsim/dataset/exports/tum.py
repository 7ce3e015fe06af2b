"""The layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012)."""

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from inspect import cleandoc
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose
from pipeline.datasets.recorded_robot import Joints, OdometrySample
from pipeline.frame import Frame, Intrinsics
from pipeline.mapper import Keyframe, Mapper
from pipeline.robot import Motion, Velocity
from pipeline.sink import Result, Sink, Step
from sarsim.dataset.exports.export import Export, atomic_folder, room_name, write_description, write_image
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene

DEPTH_SCALE = 5000  # Depth units per metre
DIGITS = 12  # Number of significant digits of readings, poses and intrinsics


@dataclass(frozen=True)
class Tum(Export):
    """For each scene, the images in rgb/, depth/ (16 bits, 5000 per metre) and label/, and a list of each kind.

    groundtruth.txt holds the true poses of the camera, odometry.txt its poses by dead reckoning with wheels and gyro,
    camera.txt its pose on the robot.
    """

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write a sequence for the scene."""
        sequence = TumSequence(folder / room_name(entry))
        for index, frame in enumerate(scene):
            sequence.add_frame(frame)
            sequence.add_pose("groundtruth", frame.time, scene.T_world_camera(index))
            sequence.add_pose("odometry", frame.time, frame.T_odom_base @ frame.T_base_camera)
            if not index:
                sequence.add_pose("camera", frame.time, frame.T_base_camera)
        sequence.save(scene.intrinsics)


HEADERS = {
    "rgb": ["# color images", "# timestamp filename"],
    "depth": ["# depth maps", "# timestamp filename"],
    "label": ["# label maps", "# timestamp filename"],
    "groundtruth": ["# ground truth trajectory", "# timestamp tx ty tz qx qy qz qw"],
    "odometry": ["# dead reckoning", "# timestamp tx ty tz qx qy qz qw"],
    "accelerometer": ["# accelerometer data, m/s^2, x forward, y left, z up", "# timestamp ax ay az"],
    "gyroscope": ["# gyroscope data, rad/s, x forward, y left, z up", "# timestamp wx wy wz"],
    "camera": ["# the camera on the robot", "# timestamp tx ty tz qx qy qz qw"],
    "keyframes": ["# images that went into the robot's maps", "# timestamp labelled robot_stood"],
}
IMAGES = ("rgb", "depth", "label")


class TumSequence:
    """Writes a sequence of the benchmark: image by image, and finally the lists of images and readings."""

    def __init__(self, folder: Path):
        """Create the folder; OSError, here or later, if it cannot be written."""
        self._folder, self._lists = folder, dict[str, list[str]]()
        for kind in IMAGES:
            (folder / kind).mkdir(parents=True)

    def add_frame(self, frame: Frame) -> None:
        """Write the images of a frame, including its true labels if it has them."""
        depth = np.rint(np.where(frame.returns, frame.depth, 0) * DEPTH_SCALE).astype(np.uint16)
        for kind, image in zip(IMAGES, (frame.rgb, depth, frame.label), strict=True):
            if image is not None:
                name = f"{kind}/{frame.time:.6f}.png"
                write_image(self._folder / name, image, cv2.IMWRITE_PNG_COMPRESSION, 1)
                self._lists.setdefault(kind, []).append(f"{frame.time:.6f} {name}")

    def add_pose(self, kind: str, time: float, T: Pose) -> None:
        """Append the camera's 4×4 pose at a time, s, to the list ``kind``."""
        self.add_reading(kind, time, [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()])

    def add_reading(self, kind: str, time: float, values: Iterable[float]) -> None:
        """Append a reading at a time, s, to the list ``kind``."""
        # Precise enough that these files and the scene's file give the same maps.
        line = " ".join([f"{time:.6f}", *(f"{number:.{DIGITS}g}" for number in values)])
        self._lists.setdefault(kind, []).append(line)

    def save(self, intrinsics: Intrinsics) -> None:
        """Write the lists and the calibration."""
        for kind, lines in self._lists.items():
            (self._folder / f"{kind}.txt").write_text("\n".join([*HEADERS[kind], *lines]) + "\n")
        (self._folder / "calibration.txt").write_text(calibration(intrinsics))


class TumDrive(ExitStack, Sink):
    """A robot's drive as one sequence of the TUM RGB-D benchmark.

    - rgb/, depth/ (16 bits, 5000 per metre), label/: images, with a list of each kind.
    - accelerometer.txt, as in the benchmark, and gyroscope.txt: readings of the IMU in base_link.
    - groundtruth.txt and odometry.txt: poses of the camera every control period.
    - camera.txt: pose of the camera in base_link.
    - keyframes.txt: images that went into the robot's maps, and whether the robot labelled each and stood still.
    """

    def __init__(self, path: Path, seed: int):
        """Record the reports of a :class:`pipeline.datasets.recorded_robot.ReportingRobot`, until closed.

        Raises:
            InputError: ``path``, which appears on closing, exists and is not an empty folder, or cannot be created.
        """
        super().__init__()
        folder = self.enter_context(atomic_folder(path))
        self._sequence = TumSequence(folder)
        self._poses: list[tuple[str, float, NDArray[np.float64]]] = []
        self._newest: Frame | None = None
        self._keyframes: dict[float, tuple[bool, bool]] = {}
        self.callback(self._save, folder, seed)

    def take_frame(self, frame: Frame) -> None:
        """Write a frame's images."""
        self._newest = frame
        self._sequence.add_frame(frame)

    def take_motion(self, motion: Motion, command: Velocity) -> None:
        """Add the readings of the IMU."""
        self._sequence.add_reading("accelerometer", motion.time, motion.accelerometer)
        self._sequence.add_reading("gyroscope", motion.time, motion.gyro)

    def take_joints(self, time: float, joints: Joints) -> None:
        """Ignore the joints, because the benchmark has no file for wheels."""

    def take_odometry(self, odometry: OdometrySample) -> None:
        """Add the robot's pose by odometry, and its true pose if it is known."""
        self._poses.append(("odometry", odometry.time, odometry.T_odom_base))
        if odometry.T_world_base is not None:
            self._poses.append(("groundtruth", odometry.time, odometry.T_world_base))

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Record a keyframe, and whether it is labelled."""
        self._keyframes[keyframe.frame.time] = len(keyframe.labels) > 0, False

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Record that the robot stood still at the step's keyframe."""
        self._keyframes[step.keyframe.frame.time] = len(step.keyframe.labels) > 0, True

    def finish(self, result: Result) -> None:
        """Complete the folder; InputError if the folder cannot be written."""
        self.close()

    def _save(self, folder: Path, seed: int) -> None:
        if self._newest is None:
            return
        self._sequence.add_pose("camera", self._newest.time, self._newest.T_base_camera)
        for time, numbers in self._keyframes.items():
            self._sequence.add_reading("keyframes", time, numbers)
        for kind, time, T in self._poses:
            self._sequence.add_pose(kind, time, T @ self._newest.T_base_camera)
        self._sequence.save(self._newest.intrinsics)
        layout, generator = cleandoc(str(TumDrive.__doc__)), f"sarsim {version('sarsim')}"
        write_description(folder, folder.name, layout, {folder.name: self._newest.intrinsics}, 1, generator, seed)


def calibration(k: Intrinsics) -> str:
    """fx fy cx cy in the convention of the benchmark's tools: pixel centres at integer coordinates."""
    values = (k.fx, k.fy, k.cx - 0.5, k.cy - 0.5)
    return "# fx fy cx cy\n" + " ".join(f"{value:.{DIGITS}g}" for value in values) + "\n"
