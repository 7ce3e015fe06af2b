"""Read ROS 2 bags, stored as MCAP or SQLite, and ROS 1 bags."""

import heapq
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from pipeline.arrays import Direction, Pose
from pipeline.datasets.cameras import (
    EXTRINSIC_TYPE,
    IMAGE_TYPES,
    INFO_TYPE,
    ImageSource,
    RgbdCamera,
    extrinsic,
    info_topic,
    stream_of,
)
from pipeline.datasets.config import DatasetsConfig
from pipeline.datasets.images import DEPTH_ENCODINGS, colour_of, depth_of, is_depth, label_of
from pipeline.datasets.links import TF_TYPES, FrameTree, tf_topics
from pipeline.datasets.message_types import STORE
from pipeline.datasets.messages import CAMERA, NS_PER_S, Message, pose_matrix, seconds, vector_of
from pipeline.datasets.recording import BAG_ENDINGS, Recording, describes_bag
from pipeline.errors import InputError, required
from pipeline.files import check_regular
from pipeline.frame import SAME_TIME, Calibration, Frame
from pipeline.localisation.trajectory import Trajectory
from pipeline.sensor import XTION

KEYFRAME_TOPIC, LABELLED_TOPIC, STEP_TOPIC = "/keyframe", "/semantic_cloud", "/map"
TRUTH_TOPIC, LABEL_TOPIC = "/ground_truth/pose", "/camera/label/image_raw"  # Topics of sarsim's own bags
POSE_TYPE = "geometry_msgs/msg/PoseStamped"  # Type of the keyframes and the true poses in sarsim's own bags
DEVICE_TYPE = "diagnostic_msgs/msg/KeyValue"  # Camera properties recorded by RealSense's viewer, such as the name
MAX_DELAY = 3.0  # s, maximum delay of an image in a bag relative to images of the same time
INFRARED_PATTERN = re.compile("/(infra|ir/)", re.IGNORECASE)  # Found in the names of topics with infrared images


def read_ros_bag(
    path: Path,
    topics: Sequence[str] = (),
    calibration: Calibration | None = None,
    *,
    config: DatasetsConfig = DatasetsConfig(),
) -> Recording:
    """The recording in a bag: images, odometry, transforms and accelerations.

    Bags of sarsim also contain keyframes and the ground truth.

    Args:
        path: the bag's folder or file.
        topics: names of topics to use if the bag has several topics of one kind.
        calibration: intrinsics of the camera, which override those from ``camera_info``.
        config: settings for reading recordings.

    Raises:
        InputError: the bag is missing or broken, or lacks necessary data.
    """
    with _opened(path) as reader:
        chosen = Topics(path, reader, topics)
        non_image_data = _NonImageData(reader, chosen)
        span = reader.duration / NS_PER_S
    depth, colour = non_image_data.sources(chosen)
    camera = RgbdCamera(path, depth, colour, non_image_data.frame_tree, calibration)
    mount = non_image_data.frame_tree.mount(camera.frame)
    recording = Recording(
        path, lambda: _frames(recording, chosen, camera, mount.T_base_camera, span, config.buffered)
    )
    odometry = [(time, T @ mount.T_driven_base) for time, T in non_image_data.odometry(camera.frame)]
    recording.odometry = non_image_data.trajectory("odometry", odometry)
    recording.truth = non_image_data.trajectory("true poses", non_image_data.true_poses)
    recording.keyframes = {time: time in non_image_data.labelled for time in non_image_data.keyframes} or None
    recording.steps = non_image_data.steps
    recording.has_camera_pose = mount.T_base_camera is not None
    recording.up = non_image_data.up(camera.frame, config.at_rest)
    if camera.frame == CAMERA:
        recording.sensor = XTION  # sarsim's own camera has a frame of this name
    else:
        frames = [source.frame for source in (depth, colour) if source is not None]
        recording.take_sensor([*non_image_data.devices, chosen.depth, *frames, path.resolve().name])
    for line in filter(None, (*chosen.notes, *non_image_data.notes, camera.note, mount.note)):
        recording.note(line)
    if recording.odometry is None and non_image_data.frame_tree.has_moving_frames:
        found = f"neither nav_msgs/Odometry nor transforms from odom, only {non_image_data.frame_tree}"
        recording.note(f"no odometry: the bag contains {found}")
    return recording


@contextmanager
def _opened(path: Path) -> Iterator[AnyReader]:
    """A reader of a bag; all errors of the reader are raised as InputError."""
    alone = sorted(file for file in path.iterdir() if file.suffix in BAG_ENDINGS) if path.is_dir() else []
    # The reader would mistake a folder whose name ends in .bag for a file of ROS 1.
    is_lone = len(alone) == 1 and (path.suffix == ".bag" or not describes_bag(path / "metadata.yaml"))
    file = alone[0] if is_lone else path
    if file.exists() and not file.is_dir():
        check_regular(file)
    try:
        with AnyReader([file], default_typestore=STORE) as reader:
            yield reader
    except (InputError, GeneratorExit, KeyboardInterrupt):
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: not a ROS bag: {error}") from error
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: the bag is truncated, damaged or in an unknown format: {said}") from error


class Topics:
    """The topics of a bag that are used, by the kind of their data.

    Attributes:
        kinds: the types of all topics with messages, by name.
        first_messages: the first message of each topic of images or of camera_info, by name.
        depth: topic of the depth images.
        colour, odometry, imu: topics of the colour images, the odometry and the IMU data; None without such data.
        transforms: topics of the robot's transforms.
        notes: choices among topics that a user may want to change, one line each.
    """

    def __init__(self, path: Path, reader: AnyReader, named: Sequence[str]):
        """Find the topics; ``named``: topics selected by the user.

        Raises:
            InputError: the bag lacks a named topic or depth images, or has several topics of one kind and none of
                them is named.
        """
        self._path, self._named, self.notes = path, named, list[str]()
        self.kinds = {name: info.msgtype or "" for name, info in reader.topics.items() if info.msgcount}
        if unknown := [name for name in named if name not in self.kinds]:
            raise InputError(
                f"{path}: no messages on {' or '.join(unknown)} (--topics); the bag's topics are {self._listed}"
            )
        self.first_messages = {
            name: _first(reader, name) for name, kind in self.kinds.items() if kind in (*IMAGE_TYPES, INFO_TYPE)
        }
        self.depth, self.colour = self._images()
        self.odometry = self._select("odometry", self._of_type("nav_msgs/msg/Odometry"))
        self.imu = self._imu()
        self.transforms = self._transforms()

    def _images(self) -> tuple[str, str | None]:
        """The topics of the depth and colour images, which are distinguished by their encodings."""
        images = [name for name, kind in self.kinds.items() if kind in IMAGE_TYPES and name != LABEL_TOPIC]
        depths = [name for name in images if is_depth(self.first_messages[name])]
        if not depths:
            found = ", ".join(f"{name} ({self._encoding(name)})" for name in images)
            found = f"its images are {found}" if found else f"its topics are {self._listed}"
            raise InputError(
                f"{self._path}: no depth images ({', '.join(DEPTH_ENCODINGS)} or compressedDepth); {found}"
            )
        depths = self._usable(depths, lambda name: not INFRARED_PATTERN.search(name))
        colours = self._usable(
            [name for name in images if name not in depths and not is_depth(self.first_messages[name])]
        )
        colours = [name for name in colours if name in self._named or not INFRARED_PATTERN.search(name)]
        if len(depths) > 1:
            depths = self._preferred(depths, colours, lambda name: "depth" in name.lower())
        if len(colours) > 1:
            colours = self._preferred(colours, depths, lambda name: "depth" not in name.lower())
        depth, colour = self._select("depth images", depths), self._select("colour images", colours)
        if colour is None:
            self.notes.append("no colour images; all surfaces are black, and people are not detected")
        return required(depth), colour

    def _usable(self, names: list[str], is_usual: Callable[[str], bool] = lambda name: True) -> list[str]:
        """The topics named by the user, or else the raw topics that are usual, or else all raw topics.

        A topic is raw if it is not a compressed copy of another topic.
        """
        raw = [n for n in names if not any(n != m and n.startswith(f"{m}/") for m in names)]
        return [n for n in names if n in self._named] or [n for n in raw if is_usual(n)] or raw

    def _preferred(self, names: list[str], others: list[str], is_called: Callable[[str], bool]) -> list[str]:
        """The only topic with the same camera_info as an image topic of the other kind, or else with a usual name.

        All topics if neither criterion selects exactly one.
        """
        cameras = {camera for name in others if (camera := self._camera(name))}
        same = [name for name in names if self._camera(name) in cameras]
        called = [name for name in (same or names) if is_called(name)]
        found = next((few for few in (same, called) if len(few) == 1), names)
        if found != names:
            self.notes.append(f"using {found[0]} of {', '.join(names)}; to use another, name it in --topics")
        return found

    def _camera(self, topic: str) -> tuple[float, ...] | None:
        """The image size and camera matrix in the camera_info of an image topic; None if it has no camera_info."""
        name = info_topic(topic, self.kinds)
        if name is None:
            return None
        info = self.first_messages[name]
        K = info.k if hasattr(info, "k") else info.K
        return (info.width, info.height, *np.round(K, 1).tolist())

    def _encoding(self, name: str) -> str:
        image = self.first_messages[name]
        return image.format if hasattr(image, "format") else image.encoding

    @property
    def _listed(self) -> str:
        return ", ".join(sorted(self.kinds)) or "none"

    def _imu(self) -> str | None:
        imus = self._of_type("sensor_msgs/msg/Imu")
        if len(imus) == 1 or set(imus) & set(self._named):
            return self._select("IMU data", imus)
        if imus:
            self.notes.append(f"ignoring IMU data on several topics ({', '.join(imus)}); choose one with --topics")
        return None

    def _transforms(self) -> list[str]:
        every = [name for name, kind in self.kinds.items() if kind in TF_TYPES]
        robots = [name for name in (self.depth, self.odometry) if name]
        used = [name for name in every if name in self._named] or tf_topics(self.kinds, robots)
        if unused := [name for name in every if name not in used]:
            self.notes.append(
                f"ignoring transforms on {', '.join(unused)}; to use them, name their topics in --topics"
            )
        return used

    def _of_type(self, kind: str) -> list[str]:
        return [name for name, found in self.kinds.items() if found == kind]

    def _select(self, what: str, names: list[str]) -> str | None:
        """The topic to use, which is the named topic or else the raw topic; None if there is no topic.

        Raises:
            InputError: several topics are possible.
        """
        found = self._usable(names)
        if len(found) > 1:
            listed = ", ".join(found)
            raise InputError(f"{self._path}: several topics have {what}: {listed}; choose one with --topics")
        return found[0] if found else None


class _NonImageData:
    """All data of a bag except its images."""

    def __init__(self, reader: AnyReader, topics: Topics):
        self.notes: list[str] = []
        self.keyframes: list[float] = []
        self.labelled: set[float] = set()
        self.steps: set[float] = set()
        self.true_poses: list[tuple[float, Pose]] = []
        self._odometry: list[tuple[float, Pose]] = []
        self.frame_tree = FrameTree()
        self._accelerations: list[tuple[float, NDArray[np.float64]]] = []
        self._imu_frame = ""
        self._first_messages = topics.first_messages
        self._streams = [
            s for name, kind in topics.kinds.items() if kind == EXTRINSIC_TYPE and (s := stream_of(name))
        ]
        for name in [name for name in topics.kinds if stream_of(name) in self._streams]:
            self.frame_tree.set_transform(*extrinsic(name, _first(reader, name)))
        self.devices: list[str] = []
        self._infos = {name: topics.first_messages[name] for name, kind in topics.kinds.items() if kind == INFO_TYPE}
        self._imu_stream = self._stream(topics.imu) if topics.imu else ""
        poses: dict[str, Callable[[Any, float], None]] = {
            KEYFRAME_TOPIC: lambda message, time: self.keyframes.append(time),
            TRUTH_TOPIC: lambda message, time: self.true_poses.append((time, _pose(message.pose))),
        }
        takers: dict[str | None, Callable[[Any, float], None]] = {
            topics.odometry: self._take_odometry,
            topics.imu: self._take_imu,
            **dict.fromkeys(topics.transforms, self._take_tf),
            LABELLED_TOPIC: lambda message, time: self.labelled.add(time),
            STEP_TOPIC: lambda message, time: self.steps.add(time),
            **{name: self._take_device for name, kind in topics.kinds.items() if kind == DEVICE_TYPE},
            **{name: take for name, take in poses.items() if topics.kinds.get(name) == POSE_TYPE},
        }
        connections = [c for c in reader.connections if c.topic in takers]
        for connection, received, raw in reader.messages(connections) if connections else ():
            message: Any = reader.deserialize(raw, connection.msgtype)
            takers[connection.topic](message, _time(message, received))
        if self.keyframes and set(self.keyframes).isdisjoint(_times(reader, topics.depth)):
            self.notes.append(f"ignoring {KEYFRAME_TOPIC}, because no depth image has one of its times")
            self.keyframes.clear()

    def sources(self, topics: Topics) -> tuple[ImageSource, ImageSource | None]:
        """The sources of the depth and colour images, each with its first camera_info and its frame."""
        depth = self._source(topics.depth, topics)
        return depth, self._source(topics.colour, topics) if topics.colour else None

    def _source(self, topic: str, topics: Topics) -> ImageSource:
        header = self._first_messages[topic].header
        name = info_topic(topic, topics.kinds)
        if name is None:
            same = [name for name, info in self._infos.items() if info.header.frame_id == header.frame_id]
            name = same[0] if len(same) == 1 or (same and topic == topics.depth) else None
            if name is not None:
                self.notes.append(f"using {name} as the camera_info of {topic}, because they have the same frame")
        info = None if name is None else self._infos[name]
        if stream := self._stream(topic):
            return ImageSource(topic, info, stream)
        frames = [m.header.frame_id for m in (info, self._first_messages[topic]) if m is not None]
        return ImageSource(topic, info, next((frame for frame in frames if self.frame_tree.knows(frame)), frames[0]))

    def _stream(self, topic: str) -> str:
        """The frame of a RealSense stream, whose messages do not name their frame; empty for other topics."""
        return next((stream.strip("/") for stream in self._streams if topic.startswith(f"{stream}/")), "")

    def _take_odometry(self, message: Message, time: float) -> None:
        self.frame_tree.base = message.child_frame_id
        self._odometry.append((time, _pose(message.pose.pose)))

    def _take_device(self, message: Message, time: float) -> None:
        if message.key == "Name":
            self.devices.append(message.value)

    def _take_imu(self, message: Message, time: float) -> None:
        self._imu_frame = self._imu_stream or message.header.frame_id
        self._accelerations.append((time, vector_of(message.linear_acceleration)))

    def _take_tf(self, message: Message, time: float) -> None:
        for link in message.transforms:
            self.frame_tree.take(link, time)

    def odometry(self, camera: str) -> list[tuple[float, Pose]]:
        """The odometry of the robot that carries a camera: from its topic or, without one, from transforms."""
        return self._odometry or self.frame_tree.odometry(camera)

    def trajectory(self, name: str, poses: list[tuple[float, Pose]]) -> Trajectory | None:
        """The trajectory of all finite poses of a list, with their times, s; None if no pose is finite."""
        good = [(time, T) for time, T in poses if np.isfinite(T).all()]
        if len(good) < len(poses):
            self.notes.append(
                f"{name}: ignoring {len(poses) - len(good)} of {len(poses)} poses, which are not finite"
            )
        return Trajectory(np.array([t for t, _ in good]), np.array([T for _, T in good])) if good else None

    def up(self, camera: str, at_rest: float) -> Direction | None:
        """The vertical from the accelerations in the first ``at_rest`` s; None if it is unknown.

        It is a direction in ``base_link`` or, if the camera's pose on the robot is unknown, in the camera's frame.
        """
        felt = np.array(
            [a for time, a in self._accelerations if time <= self._accelerations[0][0] + at_rest]
        ).reshape(-1, 3)
        tree, imu = self.frame_tree, self._imu_frame
        in_base = tree.mount(camera).T_base_camera is not None
        T = tree.T_base(imu, camera) if in_base else tree.between(tree.named(camera), tree.named(imu))
        felt = felt[np.isfinite(felt).all(axis=1)]
        mean = felt.mean(axis=0) if len(felt) else np.zeros(3)
        if T is None or not mean.any():
            return None
        up = T[:3, :3] @ mean / np.linalg.norm(mean)
        if (up[2] if in_base else -up[1]) >= 0:
            return up
        self.notes.append("the accelerometer measures gravity downwards; taking the opposite direction for up")
        return -up


def _first(reader: AnyReader, topic: str) -> Message:
    """The first message of a topic, which must have one."""
    connections = [c for c in reader.connections if c.topic == topic]
    connection, _, raw = next(reader.messages(connections))
    return reader.deserialize(raw, connection.msgtype)


def _times(reader: AnyReader, topic: str) -> Iterator[float]:
    """The times of a topic's messages, s."""
    for connection, received, raw in reader.messages([c for c in reader.connections if c.topic == topic]):
        yield _time(reader.deserialize(raw, connection.msgtype), received)


def _time(message: Message, received: int) -> float:
    """The time of a message, s: its timestamp or, without one, the time ``received`` at which it was recorded, ns."""
    return (seconds(message.header.stamp) if hasattr(message, "header") else 0.0) or received / NS_PER_S


def _pose(message: Message) -> Pose:
    return pose_matrix(message.position, message.orientation)


def _frames(
    recording: Recording, topics: Topics, camera: RgbdCamera, T_base_camera: Pose | None, span: float, buffered: int
) -> Iterator[Frame]:
    """Yield a frame for each usable depth image, in the order of their times, with the colour image nearest in time.

    ``span``: duration of the bag, s.
    """
    place, last = np.eye(4) if T_base_camera is None else T_base_camera, -np.inf
    with _opened(recording.path) as reader:
        for time, depth, found in _matched(reader, topics, buffered):
            if last == -np.inf:
                recording.check_clocks(time, time + span)
            if time and not seconds(depth.header.stamp):
                recording.note("a depth image has no timestamp (0); using the time at which it was recorded")
            if time <= last:
                order = "with the same timestamp as another" if time == last else "that are out of order"
                recording.leave_out(f"depth images {order}")
                continue
            colour, label = found(topics.colour), found(LABEL_TOPIC)
            if topics.colour and colour is None:
                recording.leave_out("depth images without a colour image")
                continue
            last = time
            try:
                raw, shown = depth_of(depth), None if colour is None else colour_of(colour)
                true = None if label is None else label_of(label)
            except InputError as error:
                raise InputError(f"{recording.path}: {error}") from error
            metres, rgb = camera.images(raw, shown)
            yield Frame(time, rgb, metres, camera.intrinsics, place, np.eye(4), true)


ImageFinder = Callable[[str | None], Message | None]
"""A function that returns the image of a topic that matches a depth image; None if there is none."""


def _matched(reader: AnyReader, topics: Topics, buffered: int) -> Iterator[tuple[float, Message, ImageFinder]]:
    """Depth images with their times, each with a function that returns the matching image of another topic."""
    names = topics.depth, topics.colour, LABEL_TOPIC
    wanted = [c for c in reader.connections if c.topic in names and c.msgtype in IMAGE_TYPES]
    depths: list[tuple[float, int, Message]] = []
    others: dict[str, dict[float, Message]] = {topics.colour or "": {}, LABEL_TOPIC: {}}

    def finder_at(time: float) -> ImageFinder:
        def found(topic: str | None) -> Message | None:
            images = others.get(topic or "", {})
            nearest = min(images, key=lambda t: abs(t - time), default=np.inf)
            return images[nearest] if abs(nearest - time) <= (0 if topic == LABEL_TOPIC else SAME_TIME) else None

        return found

    for number, (connection, received, raw) in enumerate(reader.messages(wanted)):
        message: Any = reader.deserialize(raw, connection.msgtype)
        time = _time(message, received)
        if connection.topic == topics.depth:
            heapq.heappush(depths, (time, number, message))
        else:
            others[connection.topic][time] = message
        needed = late = time - MAX_DELAY
        while depths and (len(depths) > buffered or depths[0][0] < late):
            first, _, depth = heapq.heappop(depths)
            yield first, depth, finder_at(first)
            needed = max(needed, first)
        for images in others.values():
            for old in [t for t in images if t < needed - SAME_TIME]:
                del images[old]
    for first, _, depth in (heapq.heappop(depths) for _ in range(len(depths))):
        yield first, depth, finder_at(first)
