"""Reads a folder in the layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012), or of plain numbered images."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Direction
from pipeline.datasets.config import DatasetsConfig
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError
from pipeline.files import MOST_MEMORY, read_bytes, read_numbers, read_text
from pipeline.frame import SAME_TIME, Calibration, Frame, Intrinsics, decoded
from pipeline.localisation.trajectory import Trajectory, read_trajectory

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".ppm", ".pgm", ".tif", ".tiff")
Listed = list[tuple[float, Path]]


def read_tum_folder(
    path: Path,
    calibration: Calibration | None = None,
    depth_scale: float | None = None,
    fps: float | None = None,
    *,
    config: DatasetsConfig = DatasetsConfig(),
) -> Recording:
    """A folder with ``depth.txt`` and ``rgb.txt``, or with numbered images in ``depth`` and ``rgb`` or ``color``.

    ``groundtruth.txt`` and ``odometry.txt`` hold poses of the camera, ``calibration.txt`` the line fx fy cx cy,
    ``accelerometer.txt`` what was felt: in ``base_link`` beside a ``camera.txt``, else in the axes of a Kinect (x
    right, y up, z back) or of its camera (x right, y down, z forward), which is not upside down.

    Args:
        path: of the folder.
        calibration: of the camera; overrides that of ``calibration.txt``.
        depth_scale: units of the depth images per metre; 5000 if not given.
        fps: frames per second of images without times.
        config: how recordings are read.

    Raises:
        InputError: a file is missing or broken.
    """
    depth, colour = _listed(path, ("depth",), fps), _listed(path, ("rgb", "color"), fps)
    calibration = calibration or _calibration(path)
    place = _trajectory(path / "camera.txt")
    T_base_camera = np.eye(4) if place is None else place.poses[0]
    recording = Recording(
        path,
        lambda: (
            replace(frame, T_base_camera=T_base_camera)
            for frame in _frames(recording, depth, colour, calibration, depth_scale or config.depth_units)
        ),
        has_camera_pose=place is not None,
    )
    recording.truth = _trajectory(path / "groundtruth.txt")
    recording.odometry = _trajectory(path / "odometry.txt")
    recording.up = _up(path / "accelerometer.txt", recording.has_camera_pose, config.at_rest)
    recording.check_clocks(depth[0][0], depth[-1][0])
    if (path / "keyframes.txt").exists():
        rows = read_numbers(path / "keyframes.txt", "time labelled stood")
        recording.keyframes = {time: bool(labelled) for time, labelled, _ in rows.tolist()}
        recording.steps = set(rows[rows[:, 2] > 0, 0].tolist())
    return recording


def _trajectory(path: Path) -> Trajectory | None:
    return read_trajectory(path, of_camera=True) if path.exists() else None


def _up(path: Path, in_base: bool, at_rest: float) -> Direction | None:
    """The vertical in the first s, in ``base_link`` or else in ``camera_optical``; None if it was not felt."""
    if not path.exists():
        return None
    rows = read_numbers(path, "time ax ay az")
    felt = rows[rows[:, 0] <= rows[0, 0] + at_rest, 1:].mean(axis=0)
    if not felt.any():
        return None
    up = felt / np.linalg.norm(felt)
    return up if in_base or up[1] <= 0 else up * [1, -1, -1]


def _calibration(path: Path) -> Calibration:
    file = path / "calibration.txt"
    if not file.exists():
        raise InputError(f"{path}: has no calibration.txt; --intrinsics fx fy cx cy gives the camera's")
    rows = read_numbers(file, "fx fy cx cy")
    if len(rows) != 1 or not (rows > 0).all():
        raise InputError(f"{file}: it must be one line of fx fy cx cy, all positive")
    return Calibration(*rows[0].tolist())


def _listed(path: Path, names: tuple[str, ...], fps: float | None) -> Listed:
    """Times and files of one kind of image, in the order of time."""
    for name in names:
        if (path / f"{name}.txt").exists():
            return _from_list(path / f"{name}.txt")
    for name in names:
        files = sorted(file for file in (path / name).glob("*") if file.suffix.lower() in IMAGE_ENDINGS)
        if files:
            if fps is None:
                raise InputError(f"{path / name}: its images have no times; --fps says how many there are a second")
            return [(k / fps, file) for k, file in enumerate(files)]
    missing = " nor ".join(f"{name}.txt nor images in {name}/" for name in names)
    raise InputError(f"{path}: no recording: it has neither {missing}")


def _from_list(file: Path) -> Listed:
    found = []
    for number, line in enumerate(read_text(file).splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            time, name = float(words[0]), words[1]
        except (ValueError, IndexError):
            raise InputError(f"{file}: line {number} is not a time and a file: {line[:60]!r}") from None
        found.append((time, file.parent / name))
    if not found:
        raise InputError(f"{file}: lists no image")
    return sorted(found)


def _frames(
    recording: Recording, depth: Listed, colour: Listed, calibration: Calibration, scale: float
) -> Iterator[Frame]:
    times = np.array([time for time, _ in colour])
    size: tuple[int, ...] | None = None
    for time, file in depth:
        nearest = int(np.abs(times - time).argmin())
        if abs(times[nearest] - time) > SAME_TIME:
            recording.leave_out("depth images without a colour image")
            continue
        metres = _depth(file, scale)
        rgb = np.ascontiguousarray(_image(colour[nearest][1], cv2.IMREAD_COLOR)[..., ::-1])
        size = size or metres.shape
        if metres.shape != size or rgb.shape[:2] != size:
            sizes = " and ".join(f"{w} × {h}" for h, w in {size, metres.shape, rgb.shape[:2]})
            raise InputError(f"{file}: images of two sizes, {sizes}; depth must be registered to colour")
        fx, fy, cx, cy = calibration
        intrinsics = Intrinsics(size[1], size[0], fx, fy, cx + 0.5, cy + 0.5)
        yield Frame(time, rgb, metres, intrinsics, np.eye(4), np.eye(4))


def _depth(file: Path, scale: float) -> Depth:
    image = _image(file, cv2.IMREAD_UNCHANGED)
    if image.ndim != 2 or image.dtype not in (np.uint16, np.float32):
        raise InputError(f"{file}: not a depth image: it has {image.dtype} pixels of the shape {image.shape}")
    return np.asarray(image / np.float32(scale), np.float32)


def _image(file: Path, flags: int) -> NDArray:
    content = read_bytes(file, MOST_MEMORY)
    try:
        return decoded(content, flags)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
