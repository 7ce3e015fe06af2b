"""Find the camera_info of depth and colour images on ROS topics, and register the depth to the colour images."""

import re
from collections.abc import Mapping
from itertools import product, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Depth, Pose, Rgb
from pipeline.datasets.links import FrameTree
from pipeline.datasets.messages import Message, pose_matrix
from pipeline.datasets.pinhole import ImageRectifier
from pipeline.errors import InputError, required
from pipeline.frame import ONE_SIZE, Calibration, Intrinsics
from pipeline.transforms import inverse

IMAGE_TYPES = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
INFO_TYPE = "sensor_msgs/msg/CameraInfo"
EXTRINSIC = re.compile(r"(?P<stream>(?P<device>/device_\d+)/sensor_\d+/\w+)/tf/(?P<reference>\d+)")
EXTRINSIC_TYPE = "geometry_msgs/msg/Transform"
TRANSPORTS = "compressed", "compressedDepth", "theora", "ffmpeg", "zstd"  # image_transport's suffixes of topic names
COINCIDENCE_TOLERANCE = 1e-3  # Maximum difference between the poses of two frames that coincide, m and rad


class ImageSource(NamedTuple):
    """A topic with images of a camera.

    Attributes:
        topic: name of the topic.
        info: camera_info of the images; None if there is none.
        frame: name of the camera's frame; empty if unknown.
    """

    topic: str
    info: Message | None
    frame: str


def is_rectified(topic: str) -> bool:
    """Whether a topic's name, such as ``image_rect`` or ``image_rect_color``, indicates rectified images."""
    return "rect" in _name_parts(topic)[-1].lower()


def _name_parts(topic: str) -> list[str]:
    """The parts of a topic's name without image_transport's suffix."""
    parts = topic.strip("/").split("/")
    return parts[:-1] if parts[-1] in TRANSPORTS and len(parts) > 1 else parts


def info_topic(topic: str, kinds: Mapping[str, str]) -> str | None:
    """The camera_info topic whose name shares the most leading parts with the name of an image topic.

    A camera_info topic that shares more parts with another image topic is not considered.

    Args:
        topic: topic of the images.
        kinds: the types of all topics, by name.

    Returns:
        The topic; None if there is none, or if several share equally many parts.
    """
    images = [name for name, kind in kinds.items() if kind in IMAGE_TYPES]
    near = {
        name: shared
        for name, kind in kinds.items()
        if kind == INFO_TYPE
        and (shared := _count_shared_parts(name, topic)) > 0
        and all(_count_shared_parts(name, other) <= shared for other in images)
    }
    nearest = [name for name, shared in near.items() if shared == max(near.values())]
    return nearest[0] if len(nearest) == 1 else None


def stream_of(topic: str) -> str:
    """The RealSense stream to which a topic of extrinsics belongs; empty for other topics."""
    found = EXTRINSIC.fullmatch(topic)
    return found["stream"] if found else ""


def extrinsic(topic: str, message: Message) -> tuple[str, str, Pose]:
    """Names of a RealSense stream's frame and its device's reference frame, and the first frame's pose in the second.

    On ``STREAM/tf/REFERENCE``, librealsense records the inverse, the reference's pose in the stream, as a Transform.
    """
    found = required(EXTRINSIC.fullmatch(topic))
    T = pose_matrix(message.translation, message.rotation)
    return found["stream"].strip("/"), f"{found['device'].strip('/')}/reference_{found['reference']}", inverse(T)


def _count_shared_parts(info: str, image: str) -> int:
    """The number of leading parts that two topics' names share."""
    pairs = zip(info.strip("/").split("/"), _name_parts(image), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


class RgbdCamera:
    """Converts depth and colour images to registered pairs, as if one pinhole camera had taken both.

    Attributes:
        frame: name of the frame of both images.
        note: one line about unexpected properties of the images; empty if there are none.
    """

    def __init__(
        self,
        path: Path,
        depth: ImageSource,
        colour: ImageSource | None,
        frame_tree: FrameTree,
        calibration: Calibration | None = None,
    ):
        """Determine how depth must be registered to colour.

        Args:
            path: the recording or a topic, for error messages.
            depth: source of the depth images.
            colour: source of the colour images; None if there are none.
            frame_tree: the transforms between the frames of the cameras.
            calibration: calibration of both cameras, without distortion, that replaces their camera_info.

        Raises:
            InputError: intrinsics are missing or invalid, or the images of two cameras have different sizes and no
                transform connects the cameras.
        """
        self._path, self._depth = path, ImageRectifier(path, depth.info, calibration, is_rectified(depth.topic))
        self.frame, self.note, self._colour = depth.frame, "", self._depth
        self._T_colour_depth: Pose | None = None
        if calibration is not None or colour is None:
            return
        if colour.info is not None:
            self._colour = ImageRectifier(path, colour.info, None, is_rectified(colour.topic))
            self._register(depth.frame, colour.frame, frame_tree)
        elif depth.frame and colour.frame and not _is_same(frame_tree, depth.frame, colour.frame):
            frames = f"depth is in the frame {depth.frame}, colour in {colour.frame}"
            self.note = f"{frames}; without a camera_info for colour, depth is assumed to be registered to colour"

    def _register(self, of_depth: str, of_colour: str, frame_tree: FrameTree) -> None:
        """Find the transform with which depth must be registered to colour, unless depth is already registered."""
        named = frame_tree.named
        T = frame_tree.between(named(of_colour), named(of_depth)) if of_colour and of_depth else None
        is_one = self._depth.has_same_intrinsics(self._colour)
        if is_one and (T is None or _is_same(frame_tree, of_depth, of_colour)):
            return
        cameras = f"depth is from {_name(of_depth, self._depth)}, colour from {_name(of_colour, self._colour)}"
        if T is not None:
            self._T_colour_depth, self.frame = T, of_colour
            means = "the transforms" if of_depth != of_colour else "a common origin, because the frames are the same"
            self.note = f"{cameras}; registering depth to colour with camera_info and {means}"
            return
        found = f"{cameras}; depth is not registered to colour, and no transform connects them"
        if not self._depth.has_same_size(self._colour):
            raise InputError(f"{self._path}: {found}; record registered depth or the transform")
        self.note = f"{found}; using the images as they are"

    @property
    def intrinsics(self) -> Intrinsics:
        """Intrinsics of both images; known after the first pair."""
        return (self._depth if self._T_colour_depth is None else self._colour).intrinsics

    def images(self, depth: Depth, colour: Rgb | None) -> tuple[Depth, Rgb]:
        """Both images as if taken by one pinhole camera; the colour image is black if none is given.

        Raises:
            InputError: the images do not have the expected sizes.
        """
        metres = self._depth.rectified("depth", depth)
        rgb = np.zeros((*metres.shape, 3), np.uint8) if colour is None else self._colour.rectified("colour", colour)
        if self._T_colour_depth is not None and colour is not None:
            metres = registered(metres, self._depth.intrinsics, self._colour.intrinsics, self._T_colour_depth)
        if metres.shape != rgb.shape[:2]:
            depth_size, colour_size = (f"{width} × {height}" for height, width in (metres.shape, rgb.shape[:2]))
            found = f"depth has {depth_size} pixels and colour {colour_size}"
            raise InputError(f"{self._path}: {ONE_SIZE}, but {found}")
        return metres, rgb


def _is_same(frame_tree: FrameTree, frame: str, other: str) -> bool:
    """Whether two frames are known to coincide."""
    T = frame_tree.between(frame_tree.named(frame), frame_tree.named(other))
    return T is not None and np.allclose(T, np.eye(4), rtol=0, atol=COINCIDENCE_TOLERANCE)


def _name(frame: str, camera: ImageRectifier) -> str:
    return f"{frame or 'an unnamed camera'} ({camera})"


def registered(depth: Depth, k: Intrinsics, target: Intrinsics, T_target_camera: Pose) -> Depth:
    """A depth image reprojected into the view of another camera, m; 0 where no pixel is projected.

    Each pixel covers the pixels of the other camera whose centres lie in its projection. Where several projections
    overlap, the smallest depth is kept.

    Args:
        depth: the depth image to register.
        k, target: intrinsics of the depth camera, and of the other camera.
        T_target_camera: pose of the depth camera in the frame of the other camera.
    """
    returns = np.isfinite(depth) & (depth > 0)
    row, column = np.nonzero(returns)
    z = depth[returns].astype(np.float64)
    first, end, far = _covered(row, column, z, k, target, T_target_camera)
    seen = np.full((target.height, target.width), np.inf)
    for down in range(int(np.max(end[1] - first[1], initial=0))):
        for right in range(int(np.max(end[0] - first[0], initial=0))):
            u, v = first[0] + right, first[1] + down
            hit = (u < end[0]) & (v < end[1])
            np.minimum.at(seen, (v[hit], u[hit]), far[hit])
    return np.where(np.isfinite(seen), seen, 0).astype(np.float32)


def _covered(
    row: np.ndarray, column: np.ndarray, z: np.ndarray, k: Intrinsics, target: Intrinsics, T: Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pixels of the target image that the projections of pixels with depths ``z`` (N,), m, cover.

    ``T``: pose of the depth camera in the frame of the target camera.

    Returns:
        (2, N) first column and row, (2, N) column and row after the last, both clipped to the image, and (N,) m,
        depth in the target camera.
    """
    corners = []
    for right, down in product((0.0, 1.0), repeat=2):
        rays = np.stack([(column + right - k.cx) / k.fx, (row + down - k.cy) / k.fy, np.ones_like(z)])
        x, y, far = T[:3, :3] @ (rays * z) + T[:3, 3:]
        far = np.where(far > 0, far, np.nan)
        corners.append((x / far * target.fx + target.cx, y / far * target.fy + target.cy))
    centre = np.stack([(column + 0.5 - k.cx) / k.fx * z, (row + 0.5 - k.cy) / k.fy * z, z])
    far = T[2, :3] @ centre + T[2, 3]
    sides, size = np.array(corners), np.array([[target.width], [target.height]])
    is_before = (far > 0) & np.isfinite(sides).all(axis=(0, 1))
    sides = np.where(is_before, sides, -1.0).clip(-1, size + 1)
    first, end = (np.ceil(side - 0.5).clip(0, size).astype(np.int64) for side in (sides.min(0), sides.max(0)))
    return first, end, far
