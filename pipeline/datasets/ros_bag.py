"""Reads a ROS bag: of ROS 2 as MCAP or SQLite, or of ROS 1."""

import heapq
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from pipeline.arrays import Direction, Pose
from pipeline.datasets.config import DatasetsConfig
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError
from pipeline.files import check_regular
from pipeline.frame import SAME_TIME, Calibration, Frame
from pipeline.localisation.trajectory import Trajectory
from pipeline.ros.images import colour_of, depth_of, label_of
from pipeline.ros.links import FrameTree
from pipeline.ros.messages import BASE, NANO, ODOM, STORE, Message, pose_matrix, seconds, vector_of
from pipeline.ros.pinhole import Pinhole

KEYFRAME_TOPIC, LABELLED_TOPIC, STEP_TOPIC = "/keyframe", "/semantic_cloud", "/map"
TRUTH, LABELS = "/ground_truth/pose", "/camera/label/image_raw"  # Topics of sarsim's own bags
INFRARED = re.compile("/(infra|ir/)")  # In names of topics of infrared images
IMAGE_TYPES = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"


def read_ros_bag(
    path: Path,
    topics: Sequence[str] = (),
    calibration: Calibration | None = None,
    *,
    config: DatasetsConfig = DatasetsConfig(),
) -> Recording:
    """A bag's images, odometry, transforms and accelerometer; from sarsim's own bags also keyframes and ground truth.

    Args:
        path: of the bag's folder or file.
        topics: to use, if the bag has several of a kind.
        calibration: of the camera; overrides that of ``camera_info``.
        config: how recordings are read.

    Raises:
        InputError: the bag is missing or broken, or lacks necessary data.
    """
    with _opened(path) as reader:
        chosen = Topics(path, reader, topics)
        beside = _Beside(reader, chosen)
        span = reader.duration / NANO
    camera = Pinhole(path, beside.camera_info, calibration)
    recording = Recording(path, lambda: _frames(recording, chosen, camera, beside, span, config.buffered))
    recording.odometry, recording.truth = beside.odometry(), beside.trajectory(beside.true_poses)
    recording.keyframes = {time: time in beside.labelled for time in beside.keyframes} or None
    recording.steps = beside.steps
    recording.has_camera_pose = beside.links.T_base(beside.camera_frame) is not None
    recording.up = beside.up(config.at_rest)
    return recording


@contextmanager
def _opened(path: Path) -> Iterator[AnyReader]:
    """A reader of a bag; its errors, which are of many kinds, become InputError."""
    alone = sorted(path.glob("*.mcap")) + sorted(path.glob("*.db3")) if path.is_dir() else []
    # The reader takes a folder whose name ends with .bag for a file of ROS 1.
    is_lone = len(alone) == 1 and (path.suffix == ".bag" or not (path / "metadata.yaml").exists())
    file = alone[0] if is_lone else path
    if file.exists() and not file.is_dir():
        check_regular(file)
    try:
        with AnyReader([file], default_typestore=STORE) as reader:
            yield reader
    except (InputError, GeneratorExit, KeyboardInterrupt):
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: no bag: {error}") from error
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cut short or broken, or of an unknown kind: {said}") from error


class Topics:
    """The names of a bag's topics by their contents.

    Attributes:
        depth: of depth images.
        colour, odometry, imu: None if there is none.
        camera_info: of the depth images.
    """

    def __init__(self, path: Path, reader: AnyReader, named: Sequence[str]):
        """Find the topics; InputError if there are no depth images, or several topics of a kind but none is named."""
        self._path, self._named = path, named
        self._kinds = {name: info.msgtype for name, info in reader.topics.items() if info.msgcount}
        if unknown := [name for name in named if name not in self._kinds]:
            raise InputError(f"{path}: holds no messages of {', '.join(unknown)}")
        images = [name for name, kind in self._kinds.items() if kind in IMAGE_TYPES and name != LABELS]
        depths = [name for name in images if "depth" in name.lower()]
        depth = self._one("depth images", depths)
        if depth is None:
            raise InputError(
                f"{path}: holds no depth images; its topics are {', '.join(sorted(self._kinds)) or 'none'}"
            )
        self.depth = depth
        others = [name for name in images if name not in depths and not INFRARED.search(name)]
        self.colour = self._one("colour images", others)
        self.odometry = self._one("odometry", self._of("nav_msgs/msg/Odometry"))
        imus = self._of("sensor_msgs/msg/Imu")
        self.imu = self._one("IMUs", imus) if len(imus) == 1 or set(imus) & set(named) else None
        place = depth.removesuffix("/compressedDepth").removesuffix("/compressed").rpartition("/")[0]
        self.camera_info = f"{place}/camera_info"

    def _of(self, kind: str) -> list[str]:
        return [name for name, found in self._kinds.items() if found == kind]

    def _one(self, what: str, names: list[str]) -> str | None:
        """The topic to use: the raw one rather than compressed ones, of several the named one; None without any."""
        raw = [n for n in names if not any(n != m and n.startswith(f"{m}/") for m in names)]
        found = [n for n in names if n in self._named] or raw
        if len(found) > 1:
            listed = " and ".join(found)
            raise InputError(f"{self._path}: {what} come on {listed}; --topics names those to use")
        return found[0] if found else None


class _Beside:
    """All data of a bag except its images."""

    def __init__(self, reader: AnyReader, topics: Topics):
        self.camera_info: Message | None = None
        self.camera_frame = ""
        self.keyframes: list[float] = []
        self.labelled: set[float] = set()
        self.steps: set[float] = set()
        self.true_poses: list[tuple[float, Pose]] = []
        self._odometry: list[tuple[float, Pose]] = []
        self._by_tf: list[tuple[float, Pose]] = []
        self.links = FrameTree()
        self._felt: list[tuple[float, Pose]] = []
        self._imu_frame = ""
        takers: dict[str | None, Callable[[Any], None]] = {
            topics.camera_info: self._take_camera_info,
            topics.odometry: self._take_odometry,
            topics.imu: self._take_imu,
            "/tf": self._take_tf,
            "/tf_static": self._take_tf,
            KEYFRAME_TOPIC: lambda message: self.keyframes.append(seconds(message.header.stamp)),
            LABELLED_TOPIC: lambda message: self.labelled.add(seconds(message.header.stamp)),
            STEP_TOPIC: lambda message: self.steps.add(seconds(message.header.stamp)),
            TRUTH: lambda m: self.true_poses.append(_stamped(m, m.pose)),
        }
        connections = [c for c in reader.connections if c.topic in takers]
        for connection, _, raw in reader.messages(connections) if connections else ():
            takers[connection.topic](reader.deserialize(raw, connection.msgtype))

    def _take_camera_info(self, message: Message) -> None:
        self.camera_info = self.camera_info or message
        self.camera_frame = message.header.frame_id

    def _take_odometry(self, message: Message) -> None:
        self.links.base = message.child_frame_id or BASE
        self._odometry.append(_stamped(message, message.pose.pose))

    def _take_imu(self, message: Message) -> None:
        self._imu_frame = message.header.frame_id
        self._felt.append((seconds(message.header.stamp), vector_of(message.linear_acceleration)))

    def _take_tf(self, message: Message) -> None:
        for link in message.transforms:
            parent, T = self.links.take(link)
            if parent == ODOM:
                self._by_tf.append((seconds(link.header.stamp), T))

    def odometry(self) -> Trajectory | None:
        """The odometry by its own topic, or else by the transforms from ``odom``."""
        return self.trajectory(self._odometry or self._by_tf)

    def trajectory(self, poses: list[tuple[float, Pose]]) -> Trajectory | None:
        """The trajectory of poses at their times, s, without poses that are not finite."""
        good = [(time, T) for time, T in poses if np.isfinite(T).all()]
        return Trajectory(np.array([t for t, _ in good]), np.array([T for _, T in good])) if good else None

    def up(self, at_rest: float) -> Direction | None:
        """The vertical by the accelerometer in the first s, in the robot's frame or else in the camera's."""
        felt = np.array([a for time, a in self._felt if time <= self._felt[0][0] + at_rest]).reshape(-1, 3)
        in_base = self.links.T_base(self.camera_frame) is not None
        T = self.links.T_base(self._imu_frame) if in_base else self.links.between(self.camera_frame, self._imu_frame)
        mean = felt.mean(axis=0) if len(felt) and np.isfinite(felt).all() else np.zeros(3)
        return None if T is None or not mean.any() else T[:3, :3] @ mean / np.linalg.norm(mean)


def _stamped(message: Message, pose: Message) -> tuple[float, Pose]:
    return seconds(message.header.stamp), pose_matrix(pose.position, pose.orientation)


def _frames(
    recording: Recording, topics: Topics, camera: Pinhole, beside: _Beside, span: float, buffered: int
) -> Iterator[Frame]:
    """Frames of each depth image and the colour image nearest in time, in the order of their stamps."""
    T_base_camera = beside.links.T_base(beside.camera_frame)
    place, last = np.eye(4) if T_base_camera is None else T_base_camera, -np.inf
    with _opened(recording.path) as reader:
        for time, depth, found in _matched(reader, topics, buffered):
            if last == -np.inf:
                recording.check_clocks(time, time + span)
            if time <= last:
                recording.leave_out("depth images that are out of order")
                continue
            colour, label = found(topics.colour), found(LABELS)
            if topics.colour and colour is None:
                recording.leave_out("depth images without a colour image")
                continue
            last = time
            metres = camera.depth(depth_of(depth))
            rgb = np.zeros((*metres.shape, 3), np.uint8) if colour is None else camera.colour(colour_of(colour))
            true = None if label is None else label_of(label)
            yield Frame(time, rgb, metres, camera.intrinsics, place, np.eye(4), true)


Found = Callable[[str | None], Message | None]


def _matched(reader: AnyReader, topics: Topics, buffered: int) -> Iterator[tuple[float, Message, Found]]:
    """Depth images with their times, and for each a function that returns its other image of a topic."""
    wanted = [c for c in reader.connections if c.topic in (topics.depth, topics.colour, LABELS)]
    depths: list[tuple[float, int, Message]] = []
    others: dict[str, dict[float, Message]] = {topics.colour or "": {}, LABELS: {}}

    def finder(time: float) -> Found:
        def found(topic: str | None) -> Message | None:
            images = others.get(topic or "", {})
            nearest = min(images, key=lambda t: abs(t - time), default=np.inf)
            return images[nearest] if abs(nearest - time) <= (0 if topic == LABELS else SAME_TIME) else None

        return found

    for number, (connection, _, raw) in enumerate(reader.messages(wanted)):
        message: Any = reader.deserialize(raw, connection.msgtype)
        time = seconds(message.header.stamp)
        if connection.topic == topics.depth:
            heapq.heappush(depths, (time, number, message))
        else:
            others[connection.topic][time] = message
        if len(depths) > buffered:
            first, _, depth = heapq.heappop(depths)
            yield first, depth, finder(first)
            for images in others.values():
                for old in [t for t in images if t < first - SAME_TIME]:
                    del images[old]
    for first, _, depth in (heapq.heappop(depths) for _ in range(len(depths))):
        yield first, depth, finder(first)
