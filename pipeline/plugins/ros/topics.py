"""Send a robot's sensor data and maps, topic by topic, to a bag or to a network."""

from collections.abc import Callable
from typing import Literal

import cv2
import numpy as np

from pipeline.arrays import Pose
from pipeline.datasets.messages import BASE, CAMERA, MAP, ODOM, Message
from pipeline.datasets.recorded_robot import Joints, OdometrySample
from pipeline.frame import Frame
from pipeline.geometry.thinning import VoxelCloud
from pipeline.labels import PERSON_COLOUR
from pipeline.mapper import Keyframe, Mapper
from pipeline.planning.path_plan import PathPlan
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.config import RosConfig
from pipeline.robot import Motion, Velocity

ImageFormat = Literal["16UC1", "32FC1", "16UC1-jpeg", "32FC1-jpeg"]
"""Encoding of depth, in whole mm or in m (REP 118), followed by ``-jpeg`` if colour images are compressed."""
Send = Callable[[str, float, Message], None]  # Function that takes a topic, the time in s and a message
POSE_TOLERANCE = 1e-6
"""Maximum change of any element of the camera's pose that is not sent, because a simulator may have rounded it."""


class RobotTopics:
    """A :class:`~pipeline.datasets.recorded_robot.Listener` that sends a robot's sensor data and pose."""

    def __init__(self, send: Send, images: ImageFormat = "16UC1"):
        self._send, self._depth_encoding, self._is_jpeg = send, images[:5], images.endswith("jpeg")
        self._T_base_camera: Pose | None = None

    def take_frame(self, frame: Frame) -> None:
        """Send both images, their intrinsics, true labels if there are any, and the camera's pose if it changed."""
        time, before = frame.time, self._T_base_camera
        if before is None or not np.allclose(before, frame.T_base_camera, rtol=0, atol=POSE_TOLERANCE):
            self._T_base_camera = frame.T_base_camera
            self._send("/tf_static", time, messages.transforms(time, {(BASE, CAMERA): frame.T_base_camera}))
        for kind in ("color", "depth"):
            self._send(f"/camera/{kind}/camera_info", time, messages.camera_info(time, frame.intrinsics))
        if self._is_jpeg:
            _, data = cv2.imencode(".jpg", frame.rgb[..., ::-1])
            colour = messages.compressed_image(time, "rgb8; jpeg compressed bgr8", data.ravel())
            self._send("/camera/color/image_raw/compressed", time, colour)
        else:
            self._send("/camera/color/image_raw", time, messages.image(time, "rgb8", frame.rgb))
        if frame.label is not None:
            self._send("/camera/label/image_raw", time, messages.image(time, "8UC1", frame.label))
        # The depth image is sent last, so that listeners have all other messages when it arrives.
        metres = np.where(frame.returns, frame.depth, 0).astype(np.float32)
        pixels = metres if self._depth_encoding == "32FC1" else frame.depth_mm
        self._send("/camera/depth/image_raw", time, messages.image(time, self._depth_encoding, pixels))

    def take_odometry(self, odometry: OdometrySample) -> None:
        """Send the odometry and, if they are known, the pose of ``odom`` in ``map`` and the robot's true pose."""
        time, T_odom_base, twist, T_map_odom, T_world_base = odometry
        self._send("/odom", time, messages.odometry(time, T_odom_base, twist))
        links = {(ODOM, BASE): T_odom_base} | ({} if T_map_odom is None else {(MAP, ODOM): T_map_odom})
        self._send("/tf", time, messages.transforms(time, links))
        if T_world_base is not None:
            self._send("/ground_truth/pose", time, messages.pose_stamped(time, MAP, T_world_base))

    def take_motion(self, motion: Motion, command: Velocity | None = None) -> None:
        """Send the time and the inertial measurements of a motion and, if given, the command."""
        self._send("/clock", motion.time, messages.clock(motion.time))
        if command is not None:
            self._send("/cmd_vel", motion.time, messages.velocity(command))
        self._send("/imu", motion.time, messages.imu(motion))

    def take_joints(self, time: float, joints: Joints) -> None:
        """Send the wheels' angles and speeds, measured at ``time``, s."""
        self._send("/joint_states", time, messages.joint_states(time, *joints))


class MapTopics:
    """Sends a mapper's keyframes and maps."""

    def __init__(self, send: Send, *, config: RosConfig = RosConfig()):
        self._send, self._config = send, config

    def send_keyframe(self, keyframe: Keyframe) -> None:
        """Send a keyframe's pose and, if it was labelled, its points as ``semantic_cloud``."""
        time = keyframe.frame.time
        self._send("/keyframe", time, messages.pose_stamped(time, MAP, keyframe.T_map_base))
        if len(keyframe.labels):
            cloud = VoxelCloud.of(keyframe.points, self._config.cloud_voxel)
            labels = cloud.means(np.eye(int(keyframe.labels.max()) + 1, dtype=np.float32)[keyframe.labels])
            named = labels.argmax(axis=1).astype(np.uint8)
            self._send("/semantic_cloud", time, messages.labelled_cloud(time, cloud.points, named))

    def send_maps(self, mapper: Mapper, keyframe: Keyframe, plan: PathPlan | None) -> None:
        """Send the traversable ground, the path driven so far, the plan, and markers of nodes, edges and finds."""
        time, traversability = keyframe.frame.time, mapper.drivable
        known = np.where(traversability.hazard, 100, 0)
        values = np.where(np.isnan(traversability.elevation), -1, known).astype(np.int8)
        self._send("/map", time, messages.occupancy_grid(time, traversability.grid, values))
        self._send("/path", time, messages.path(time, mapper.keyframes.poses[:, :3, 3]))
        way = np.zeros((0, 3)) if plan is None else np.vstack([keyframe.T_map_base[:3, 3], plan.waypoints])
        self._send("/plan", time, messages.path(time, way))
        self._send("/markers", time, self._markers(mapper, time))

    def _markers(self, mapper: Mapper, time: float) -> Message:
        topology = mapper.topological_map
        nodes = np.array([node.position for node in topology.nodes.values()]).reshape(-1, 3)
        ways = [topology.edge_path(a, b) for a, b in topology.graph.edges]
        reported = mapper.finds.reported if mapper.readers is not None else []
        edges = np.concatenate([np.zeros((0, 3)), *(np.repeat(way, 2, axis=0)[1:-1] for way in ways)])
        people = np.array([victim.position for victim in mapper.victims.confirmed]).reshape(-1, 3)
        finds = np.array([find.position for find in reported]).reshape(-1, 3)
        drawn = [
            messages.marker(time, "nodes", "SPHERE_LIST", nodes, 0.15, "royalblue"),
            messages.marker(time, "edges", "LINE_LIST", edges, 0.03, "silver"),
            messages.marker(time, "finds", "SPHERE_LIST", finds, 0.2, "darkorange"),
            messages.marker(time, "people", "SPHERE_LIST", people, 0.4, PERSON_COLOUR),
        ]
        return messages.make("visualization_msgs/MarkerArray", drawn)
