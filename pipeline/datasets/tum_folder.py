"""Read folders in the layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012), and folders of numbered images."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Direction, Values
from pipeline.datasets.config import DatasetsConfig
from pipeline.datasets.image_pairs import UNITS, Pair, image_pairs
from pipeline.datasets.images import metres
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError
from pipeline.files import MAX_MEMORY, read_bytes, read_numbers, read_text
from pipeline.frame import ONE_SIZE, Calibration, Frame, Intrinsics, decoded
from pipeline.localisation.trajectory import Trajectory, in_seconds, read_trajectory
from pipeline.sensor import XTION

POSE_FILE_PATTERN = re.compile("pose|traj|odom|ground|freiburg|\\bgt\\b|\\.tum$", re.IGNORECASE)
"""Found in the names of files that probably contain poses."""
POSE_FILES = "groundtruth.txt", "odometry.txt"  # The files from which poses are read
MIN_STEP = 5e-4  # s, minimum plausible median interval between poses


def read_tum_folder(
    path: Path,
    calibration: Calibration | None = None,
    depth_scale: float | None = None,
    fps: float | None = None,
    *,
    config: DatasetsConfig = DatasetsConfig(),
) -> Recording:
    """The recording in a folder with lists of images, ``depth.txt`` and ``rgb.txt``, or with folders of images.

    Without lists, the depth images are in ``depth`` and the colour images in ``rgb`` or ``color``. Images are paired
    by ``associations.txt``, by their times, or by the numbers in their names. Times are in s, or in ms, µs or ns if
    one of these units is more plausible.

    The folder may also contain these files:

    - ``groundtruth.txt`` and ``odometry.txt``: poses of the camera.
    - ``calibration.txt``: a line with fx, fy, cx and cy, required without ``calibration``.
    - ``camera.txt``: pose of the camera in ``base_link``.
    - ``accelerometer.txt``: accelerations, in ``base_link`` if there is a ``camera.txt``. Otherwise, their axes are
      those of a Kinect (x right, y up, z back) or of its camera (x right, y down, z forward), and the camera is
      assumed not to be upside down.

    Args:
        path: the folder.
        calibration: intrinsics of the camera, which override those in ``calibration.txt``.
        depth_scale: units of the depth images per metre; by default, ``config.depth_units`` or, for float images, 1.
        fps: frames per second of images without times.
        config: settings for reading recordings.

    Raises:
        InputError: a file is missing or broken.
    """
    place = _trajectory(path / "camera.txt")
    T_base_camera = np.eye(4) if place is None else place.poses[0]
    recording = Recording(
        path,
        lambda: (
            replace(frame, T_base_camera=T_base_camera)
            for frame in _frames(recording, pairs, camera, depth_scale, config.depth_units)
        ),
        has_camera_pose=place is not None,
    )
    pairs = image_pairs(path, fps, recording.note)
    _note_missing(recording, pairs)
    camera = calibration or _calibration(path)
    if (path / "label.txt").exists():  # only sarsim writes true labels
        recording.sensor = XTION
    else:
        recording.take_sensor([path.resolve().name, *_comments(path / "depth.txt")])
    span = pairs[0].time, pairs[-1].time
    recording.truth = _trajectory(path / "groundtruth.txt", recording, span, fps)
    recording.odometry = _trajectory(path / "odometry.txt", recording, span, fps)
    if unread := sorted(
        file.name for file in path.iterdir() if POSE_FILE_PATTERN.search(file.name) and file.name not in POSE_FILES
    ):
        recording.note(f"not reading {', '.join(unread)}; poses are read from groundtruth.txt and odometry.txt")
    recording.up = _up(path / "accelerometer.txt", recording, config.at_rest)
    recording.check_clocks(*span)
    if (path / "keyframes.txt").exists():
        rows = read_numbers(path / "keyframes.txt", "time labelled stood")
        rows[:, 0] = in_seconds(rows[:, 0])
        recording.keyframes = {time: bool(labelled) for time, labelled, _ in rows.tolist()}
        recording.steps = set(rows[rows[:, 2] > 0, 0].tolist())
    return recording


def _note_missing(recording: Recording, pairs: Sequence[Pair]) -> None:
    """Note how many listed images are missing; InputError if no pair of images exists."""
    listed = [file for pair in pairs for file in (pair.depth, pair.colour) if file is not None]
    missing = [file for file in listed if not file.exists()]
    if not missing:
        return
    found = f"{len(missing)} of {len(listed)} listed images are missing; the first is {missing[0]}"
    if not any(pair.depth.exists() and pair.colour and pair.colour.exists() for pair in pairs):
        raise InputError(f"{recording.path}: {found}")
    recording.note(found)


def _comments(path: Path) -> list[str]:
    """The comments in a list of images, which name the sequence in the TUM benchmark; empty without the list."""
    lines = read_text(path).splitlines() if path.exists() else []
    return [line.strip("# ") for line in lines if line.startswith("#")]


def _trajectory(
    path: Path, recording: Recording | None = None, span: tuple[float, float] = (0.0, 0.0), fps: float | None = None
) -> Trajectory | None:
    """The poses in a file; None if the file does not exist.

    The times are converted to s. Their unit, which may be frame numbers at ``fps`` frames per second, is the one with
    which they best fit ``span``, the times of the first and last images, s.
    """
    if not path.exists():
        return None
    found = read_trajectory(path, of_camera=True)
    if recording is not None and found.left_out:
        skipped = f"{found.left_out} of {found.left_out + len(found.times)} lines"
        recording.note(f"{path.name}: ignoring {skipped}, which have non-finite numbers or a zero quaternion")
    if recording is not None and (unit := _unit(found.times, span, fps)) != 1:
        taken = UNITS.get(unit, "frame numbers")
        recording.note(f"{path.name}: the times are taken for {taken}, as they then fit those of the images")
        found.times = found.times / unit
    return found


def _unit(times: Values, span: tuple[float, float], fps: float | None) -> float:
    """Number of time units per second with which ``times`` best cover a ``span``, s; 1 if no unit fits.

    The intervals between the times must be plausible.
    """
    step = float(np.median(np.diff(np.unique(times)))) if np.ptp(times) else 0.0

    def fit(unit: float) -> float:
        first, last = times[0] / unit, times[-1] / unit
        shared, whole = min(last, span[1]) - max(first, span[0]), max(last, span[1]) - min(first, span[0])
        return shared / whole if whole > 0 and step / unit >= MIN_STEP else 0.0

    best = max([*UNITS, *([fps] if fps else [])], key=fit)
    return best if fit(best) > max(fit(1.0), 0.0) else 1.0


def _up(path: Path, recording: Recording, at_rest: float) -> Direction | None:
    """The vertical measured in the first ``at_rest`` s; None if it was not measured.

    The vertical is given in ``base_link`` or, if the camera's pose on the robot is unknown, in ``camera_optical``.
    """
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
    content = read_bytes(file, MAX_MEMORY)
    try:
        return decoded(content, flags)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
