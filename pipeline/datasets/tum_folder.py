"""Read a folder in the layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012), or of plain numbered images."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Direction
from pipeline.datasets.config import DatasetsConfig
from pipeline.datasets.image_pairs import Pair, image_pairs
from pipeline.datasets.images import metres
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError
from pipeline.files import MOST_MEMORY, read_bytes, read_numbers
from pipeline.frame import ONE_SIZE, Calibration, Frame, Intrinsics, decoded
from pipeline.localisation.trajectory import Trajectory, in_seconds, read_trajectory


def read_tum_folder(
    path: Path,
    calibration: Calibration | None = None,
    depth_scale: float | None = None,
    fps: float | None = None,
    *,
    config: DatasetsConfig = DatasetsConfig(),
) -> Recording:
    """A recording in a folder with ``depth.txt`` and ``rgb.txt``, or images in ``depth`` and ``rgb`` or ``color``.

    Images are paired by ``associations.txt``, by their times, or by the numbers in their names. Times are in s, or in
    ms, µs or ns since 1970.

    ``groundtruth.txt`` and ``odometry.txt`` hold poses of the camera, ``calibration.txt`` the line fx fy cx cy, and
    ``accelerometer.txt`` accelerations: in ``base_link`` if there is a ``camera.txt``, else in the axes of a Kinect
    (x right, y up, z back) or its camera (x right, y down, z forward), which is assumed not to be upside down.

    Args:
        path: the folder.
        calibration: intrinsics of the camera; override those in ``calibration.txt``.
        depth_scale: units of the depth images per metre; by default those of ``config``, or 1 for float images.
        fps: frames per second of images without times.
        config: how recordings are read.

    Raises:
        InputError: a file is missing or broken.
    """
    pairs = image_pairs(path, fps, config.most_step)
    calibration = calibration or _calibration(path)
    place = _trajectory(path / "camera.txt")
    T_base_camera = np.eye(4) if place is None else place.poses[0]
    recording = Recording(
        path,
        lambda: (
            replace(frame, T_base_camera=T_base_camera)
            for frame in _frames(recording, pairs, calibration, depth_scale, config.depth_units)
        ),
        has_camera_pose=place is not None,
    )
    recording.truth = _trajectory(path / "groundtruth.txt", recording)
    recording.odometry = _trajectory(path / "odometry.txt", recording)
    recording.up = _up(path / "accelerometer.txt", recording, config.at_rest)
    recording.check_clocks(pairs[0].time, pairs[-1].time)
    if (path / "keyframes.txt").exists():
        rows = read_numbers(path / "keyframes.txt", "time labelled stood")
        rows[:, 0] = in_seconds(rows[:, 0])
        recording.keyframes = {time: bool(labelled) for time, labelled, _ in rows.tolist()}
        recording.steps = set(rows[rows[:, 2] > 0, 0].tolist())
    return recording


def _trajectory(path: Path, recording: Recording | None = None) -> Trajectory | None:
    if not path.exists():
        return None
    found = read_trajectory(path, of_camera=True)
    if recording is not None and found.left_out:
        skipped = f"{found.left_out} of {found.left_out + len(found.times)} lines"
        recording.note(f"{path.name}: ignoring {skipped}, which have non-finite numbers or a zero quaternion")
    return found


def _up(path: Path, recording: Recording, at_rest: float) -> Direction | None:
    """The vertical in the first ``at_rest`` s, in ``base_link`` or else ``camera_optical``; None if not measured."""
    if not path.exists():
        return None
    rows = read_numbers(path, "time ax ay az", finite=False)
    good = rows[np.isfinite(rows).all(axis=1)]
    if len(good) < len(rows):
        skipped = f"{len(rows) - len(good)} of {len(rows)} lines"
        recording.note(f"{path.name}: ignoring {skipped}, which have non-finite numbers")
    if not len(good):
        return None
    times = in_seconds(good[:, 0])
    felt = good[times <= times[0] + at_rest, 1:].mean(axis=0)
    if not felt.any():
        return None
    up = felt / np.linalg.norm(felt)
    return up if recording.has_camera_pose or up[1] <= 0 else up * [1, -1, -1]


def _calibration(path: Path) -> Calibration:
    file = path / "calibration.txt"
    if not file.exists():
        raise InputError(f"{path}: no calibration.txt; give the camera's intrinsics with --intrinsics fx fy cx cy")
    rows = read_numbers(file, "fx fy cx cy")
    if len(rows) != 1 or not (rows > 0).all():
        raise InputError(f"{file}: must contain exactly one line of four positive numbers, fx fy cx cy")
    return Calibration(*rows[0].tolist())


def _frames(
    recording: Recording, pairs: Sequence[Pair], calibration: Calibration, scale: float | None, usual: float
) -> Iterator[Frame]:
    size: tuple[int, ...] | None = None
    for time, file, colour in pairs:
        if colour is None:
            recording.leave_out("depth images without a colour image")
            continue
        if not (file.exists() and colour.exists()):
            recording.leave_out("listed frames with a missing depth or colour image")
            continue
        depth = _depth(file, scale, usual)
        rgb = np.ascontiguousarray(_image(colour, cv2.IMREAD_COLOR)[..., ::-1])
        size = size or depth.shape
        if depth.shape != size or rgb.shape[:2] != size:
            sizes = ", ".join(f"{w} × {h}" for h, w in {size, depth.shape, rgb.shape[:2]})
            raise InputError(f"{file}: {ONE_SIZE}, but their sizes are {sizes}")
        fx, fy, cx, cy = calibration
        intrinsics = Intrinsics(size[1], size[0], fx, fy, cx + 0.5, cy + 0.5)
        yield Frame(time, rgb, depth, intrinsics, np.eye(4), np.eye(4))


def _depth(file: Path, scale: float | None, usual: float) -> Depth:
    image = _image(file, cv2.IMREAD_UNCHANGED)
    if image.ndim != 2 or image.dtype not in (np.uint16, np.float32):
        raise InputError(
            f"{file}: must be a one-channel uint16 or float32 depth image, not {image.dtype} with shape {image.shape}"
        )
    return metres(image, scale or (usual if image.dtype == np.uint16 else 1.0))


def _image(file: Path, flags: int) -> NDArray:
    content = read_bytes(file, MOST_MEMORY)
    try:
        return decoded(content, flags)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
