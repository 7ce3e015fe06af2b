"""The newest messages of a robot's topics, as frames and motions of the pipeline."""

from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g

from pipeline.arrays import Pose
from pipeline.datasets.cameras import ImageSource, RgbdCamera
from pipeline.datasets.depth_cameras import DEFAULT_SENSOR, camera_named, measured_by, with_overrides
from pipeline.datasets.images import colour_of, depth_of
from pipeline.datasets.links import FrameTree
from pipeline.datasets.messages import ODOM, Message, pose_matrix, seconds, vector_of
from pipeline.errors import required
from pipeline.frame import SAME_TIME, Frame
from pipeline.localisation.trajectory import Trajectory
from pipeline.plugins.ros.config import LiveConfig
from pipeline.plugins.ros.messages import decode, time_of
from pipeline.robot import Motion
from pipeline.sensor import SensorModel

SETTING_NAMES = "ros.live.depth_range", "ros.live.depth_noise"  # Names in a settings file


class SensorReceiver:
    """Receives messages, and returns the newest frame and motion.

    Attributes:
        frame_tree: transforms between the frames of the robot.
        info: the camera_info of the depth images.
        colour_info: the camera_info of the colour images; None if there is none.
        odom_frame: name of the frame in which the odometry is given.
        T_driven_base: pose of ``base_link``, which is on the ground, in the frame whose odometry is received.
        sensor: range and noise of the camera, set by :meth:`camera`; None if they are neither known nor given.
        imu_frame: name of the frame in which the inertial sensors measure; empty before their first message.
    """

    def __init__(self, half_width: float, config: LiveConfig):
        """Start without messages; ``half_width``: half the width of the robot's footprint, m."""
        self.frame_tree = FrameTree(kept=1)  # the poses are those of the topic of the odometry
        self.info: Message | None = None
        self.colour_info: Message | None = None
        self.sensor: SensorModel | None = None
        self._given_sensor = config.depth_range, config.depth_noise
        self._camera_frame = ""
        self.imu_frame, self.odom_frame = "", ODOM
        self.T_driven_base = np.eye(4)
        self._half_width = half_width
        self._depth: deque[tuple[float, str, bytes]] = deque(maxlen=config.queue)
        self._colour: deque[tuple[float, str, bytes]] = deque(maxlen=config.queue)
        self._validity = config.trajectory
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=config.odometry_queue)
        self._twist = np.zeros(2)
        self._imu_samples: list[NDArray[np.float64]] = []
        self._inertial: NDArray[np.float64] | None = None

    def take_depth(self, name: str) -> Callable[[bytes], None]:
        """A function that receives depth images as messages of the type ``name``."""
        return lambda data: self._depth.append((time_of(data), name, data))

    def take_colour(self, name: str) -> Callable[[bytes], None]:
        """A function that receives colour images as messages of the type ``name``."""
        return lambda data: self._colour.append((time_of(data), name, data))

    def take_info(self, data: bytes) -> None:
        """Receive a CameraInfo of the depth images; only the first one is used."""
        self.info = self.info or decode(data, "sensor_msgs/msg/CameraInfo")

    def take_colour_info(self, data: bytes) -> None:
        """Receive a CameraInfo of the colour images; only the first one is used."""
        self.colour_info = self.colour_info or decode(data, "sensor_msgs/msg/CameraInfo")

    def take_odometry(self, data: bytes) -> None:
        """Receive an Odometry; it is ignored if its pose is invalid or it is not newer than the previous Odometry."""
        message = decode(data, "nav_msgs/msg/Odometry")
        time, pose, twist = seconds(message.header.stamp), message.pose.pose, message.twist.twist
        T = pose_matrix(pose.position, pose.orientation)
        if np.isfinite(T).all() and (not self._poses or time > self._poses[-1][0]):
            self.frame_tree.base, self.odom_frame = message.child_frame_id, message.header.frame_id or ODOM
            self._poses.append((time, T))
            self._twist = np.array([twist.linear.x, twist.angular.z])

    def take_imu(self, data: bytes) -> None:
        """Receive an Imu; measurements that are not finite are ignored."""
        message = decode(data, "sensor_msgs/msg/Imu")
        self.imu_frame = message.header.frame_id
        felt = np.stack([vector_of(message.angular_velocity), vector_of(message.linear_acceleration)])
        if np.isfinite(felt).all():
            self._imu_samples.append(felt)

    def take_transforms(self, data: bytes) -> None:
        """Receive a TFMessage."""
        for link in decode(data, "tf2_msgs/msg/TFMessage").transforms:
            self.frame_tree.take(link)

    def take_transform(self, data: bytes) -> None:
        """Receive a TransformStamped."""
        self.frame_tree.take(decode(data, "geometry_msgs/msg/TransformStamped"))

    @property
    def time(self) -> float:
        """Time of the newest odometry, s; −inf before the first."""
        return self._poses[-1][0] if self._poses else -np.inf

    @property
    def odometry_period(self) -> float:
        """The median time between successive odometry messages, s."""
        return float(np.median(np.diff([time for time, _ in self._poses])))

    @property
    def pose_count(self) -> int:
        """Number of odometry poses that are kept."""
        return len(self._poses)

    @property
    def image_time(self) -> float:
        """Time of the newest depth image, s; −inf before the first."""
        return self._depth[-1][0] if self._depth else -np.inf

    @property
    def knows_cameras(self) -> bool:
        """Whether the cameras of depth and colour, and the transform between them, are known."""
        if self.info is None or self.colour_info is None:
            return False
        frames = [self.frame_tree.named(info.header.frame_id) for info in (self.colour_info, self.info)]
        return self.frame_tree.between(*frames) is not None

    def camera(self, depth: str, colour: str) -> RgbdCamera:
        """The camera of the depth and colour images of two topics.

        Raises:
            InputError: the camera's intrinsics are missing or invalid, depth cannot be registered to colour, or the
                range or the noise in the settings is invalid.
        """
        of_depth, of_colour = (
            ImageSource(topic, info, info.header.frame_id if info else "")
            for topic, info in ((depth, self.info), (colour, self.colour_info))
        )
        camera = RgbdCamera(Path(depth), of_depth, of_colour, self.frame_tree)
        self._camera_frame = camera.frame
        named = camera_named([depth, of_depth.frame, of_colour.frame])
        if named is not None or any(self._given_sensor):
            sensor = DEFAULT_SENSOR if named is None else named[0].sensor
            self.sensor = with_overrides(sensor, *self._given_sensor, names=SETTING_NAMES)
        return camera

    def newest_frame_time(self, after: float) -> float | None:
        """The time, s, of the newest depth image after ``after`` s with a colour image and a pose, or None."""
        colours = np.array([time for time, *_ in self._colour])
        for time, *_ in reversed(self._depth):
            if time <= after or not len(colours):
                return None
            if np.abs(colours - time).min() <= SAME_TIME and self._pose(time) is not None:
                return time
        return None

    def frame(self, time: float, camera: RgbdCamera, T_base_camera: Pose) -> Frame:
        """The frame at a time that :meth:`newest_frame_time` has returned.

        Args:
            time: time of the frame, s.
            camera: the camera that took the images.
            T_base_camera: pose of the camera on the robot.

        Raises:
            InputError: the images have an unknown encoding or a wrong size, or are broken.
        """
        _, kind, depth = next(image for image in self._depth if image[0] == time)
        _, colour_kind, colour = min(self._colour, key=lambda image: abs(image[0] - time))
        T = required(self._pose(time))
        metres, rgb = camera.images(depth_of(decode(depth, kind)), colour_of(decode(colour, colour_kind)))
        frame = Frame(time, rgb, metres, camera.intrinsics, T_base_camera, T)
        return frame if self.sensor is None else measured_by(self.sensor, frame)

    def motion(self) -> Motion:
        """The newest motion, with the mean of the inertial measurements since the last call.

        Without inertial sensors, the inertial measurements are computed from the odometry.
        """
        time, T = self._poses[-1][0], self._poses[-1][1] @ self.T_driven_base
        v, omega = self._twist
        if self._imu_samples:
            R = self.frame_tree.T_base(self.imu_frame, self._camera_frame)
            mean = np.mean(self._imu_samples, axis=0)
            self._inertial, self._imu_samples = mean if R is None else mean @ R[:3, :3].T, []
        by_odometry = np.array([[0.0, 0.0, omega], g * T[2, :3]])
        gyro, accelerometer = by_odometry if self._inertial is None else self._inertial
        return Motion(time, T, gyro, accelerometer, np.array([v, v]) + self._half_width * omega * np.array([-1, 1]))

    def _pose(self, time: float) -> Pose | None:
        times, poses = np.array([t for t, _ in self._poses]), np.array([T for _, T in self._poses])
        T = Trajectory(times, poses).at(time, self._validity)
        return None if T is None else T @ self.T_driven_base
