"""Convert the pipeline's data to ROS 2 messages (Jazzy's types; units and frames as in REP 103, 105 and 118).

Serialised messages are the same in a bag and on a network.
"""

import struct
from collections.abc import Mapping, Sequence
from functools import lru_cache
from math import floor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import ImageColor
from scipy.spatial.transform import Rotation

from pipeline.arrays import Labels, Places, Points, Pose, Values
from pipeline.datasets.message_types import STORE
from pipeline.datasets.messages import BASE, CAMERA, MAP, NS_PER_S, ODOM, Message, seconds
from pipeline.frame import Intrinsics
from pipeline.grid_map import Grid
from pipeline.robot import Motion, Velocity
from pipeline.transforms import from_rotation

TYPES = STORE.types
NOTHING = np.array([], np.uint8)
POINT_FIELD: Any = TYPES["sensor_msgs/msg/PointField"]
FIELD_TYPES = {
    np.dtype(np.float32): POINT_FIELD.FLOAT32,
    np.dtype(np.int32): POINT_FIELD.INT32,
    np.dtype(np.uint16): POINT_FIELD.UINT16,
    np.dtype(np.uint8): POINT_FIELD.UINT8,
}


def make(name: str, *values: Any, **named: Any) -> Message:
    """A message of the type ``package/Name``."""
    return TYPES[name.replace("/", "/msg/")](*values, **named)


def type_of(message: Message) -> str:
    """The type of a message, ``package/msg/Name``."""
    return message.__msgtype__


def encode(message: Message) -> bytes:
    """A message as CDR."""
    return bytes(STORE.serialize_cdr(message, type_of(message)))


def decode(data: bytes, name: str) -> Message:
    """A message of the type ``package/msg/Name`` from CDR."""
    return STORE.deserialize_cdr(data, name)


def time_of(data: bytes) -> float:
    """The time, s, in the header at the start of a message as CDR.

    The rest of the message is not decoded, because images are large.
    """
    return seconds(make("builtin_interfaces/Time", *struct.unpack_from("<iI" if data[1] else ">iI", data, 4)))


def nanoseconds(time: float) -> int:
    """A time given in s, in whole ns; :func:`pipeline.datasets.messages.seconds` returns the same time again."""
    whole = floor(time)  # times since 1970 in ns have more digits than a float
    return whole * NS_PER_S + round((time - whole) * NS_PER_S)


def stamp(time: float) -> Message:
    """A time in s as builtin_interfaces/Time, to the nanosecond."""
    return make("builtin_interfaces/Time", *divmod(nanoseconds(time), NS_PER_S))


def header(time: float, frame: str) -> Message:
    """A std_msgs/Header with a time, s, and the name of a frame."""
    return make("std_msgs/Header", stamp(time), frame)


def pose(T: Pose) -> Message:
    """A pose as geometry_msgs/Pose."""
    point = make("geometry_msgs/Point", *T[:3, 3].tolist())
    return make("geometry_msgs/Pose", point, _quaternion(T))


def _quaternion(T: Pose) -> Message:
    return make("geometry_msgs/Quaternion", *_quaternion_of(T[:3, :3].tobytes()))


@lru_cache
def _quaternion_of(rotation: bytes) -> list[float]:
    """Quaternion from a rotation's float64 bytes; cached, because this step is slow and messages repeat poses."""
    return Rotation.from_matrix(np.frombuffer(rotation).reshape(3, 3)).as_quat().tolist()


def _vector(values: ArrayLike) -> Message:
    return make("geometry_msgs/Vector3", *np.asarray(values, np.float64).tolist())


def pose_stamped(time: float, frame: str, T: Pose) -> Message:
    """A pose in a frame at a time, s, as geometry_msgs/PoseStamped."""
    return make("geometry_msgs/PoseStamped", header(time, frame), pose(T))


def path(time: float, places: Places) -> Message:
    """A path through positions as nav_msgs/Path."""
    poses = [pose_stamped(time, MAP, from_rotation(np.eye(3), place)) for place in places]
    return make("nav_msgs/Path", header(time, MAP), poses)


def transforms(time: float, links: Mapping[tuple[str, str], Pose]) -> Message:
    """Poses of frames by the names of parent and child, as tf2_msgs/TFMessage."""
    return make("tf2_msgs/TFMessage", [transform(time, parent, child, T) for (parent, child), T in links.items()])


def transform(time: float, parent: str, child: str, T_parent_child: Pose) -> Message:
    """The pose of a child frame in its parent frame as geometry_msgs/TransformStamped."""
    place = make("geometry_msgs/Transform", _vector(T_parent_child[:3, 3]), _quaternion(T_parent_child))
    return make("geometry_msgs/TransformStamped", header(time, parent), child, place)


def image(time: float, encoding: str, pixels: NDArray) -> Message:
    """An image (H, W) or (H, W, C) of the camera as sensor_msgs/Image."""
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    return make("sensor_msgs/Image", header(time, CAMERA), height, width, encoding, 0, len(data) // height, data)


def compressed_image(time: float, format: str, data: NDArray[np.uint8]) -> Message:
    """The (N,) bytes of an image file of the camera, in a format such as ``jpeg``, as sensor_msgs/CompressedImage."""
    return make("sensor_msgs/CompressedImage", header(time, CAMERA), format, data)


def camera_info(time: float, k: Intrinsics) -> Message:
    """Intrinsics without distortion as sensor_msgs/CameraInfo."""
    return make(
        "sensor_msgs/CameraInfo",
        header(time, CAMERA),
        k.height,
        k.width,
        "plumb_bob",
        np.zeros(5),
        k.matrix.ravel(),
        np.eye(3).ravel(),
        np.column_stack([k.matrix, np.zeros(3)]).ravel(),
        0,
        0,
        make("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False),
    )


def odometry(time: float, T_odom_base: Pose, twist: Velocity) -> Message:
    """A pose and the velocity in ``base_link`` as nav_msgs/Odometry."""
    unknown = np.zeros((6, 6)).ravel()  # covariance
    return make(
        "nav_msgs/Odometry",
        header(time, ODOM),
        BASE,
        make("geometry_msgs/PoseWithCovariance", pose(T_odom_base), unknown),
        make("geometry_msgs/TwistWithCovariance", velocity(twist), unknown),
    )


def velocity(command: Velocity) -> Message:
    """A velocity in ``base_link`` as geometry_msgs/Twist."""
    return make("geometry_msgs/Twist", _vector([command.v, 0, 0]), _vector([0, 0, command.omega]))


def velocity_stamped(time: float, command: Velocity) -> Message:
    """A velocity in ``base_link`` at a time in s, as geometry_msgs/TwistStamped."""
    return make("geometry_msgs/TwistStamped", header(time, BASE), velocity(command))


def command_of(message: Message) -> Velocity:
    """The velocity that a Twist or TwistStamped commands; zero if it is not finite."""
    twist = message.twist if hasattr(message, "twist") else message
    v, omega = float(twist.linear.x), float(twist.angular.z)
    return Velocity(v, omega) if np.isfinite([v, omega]).all() else Velocity()


def imu(motion: Motion) -> Message:
    """Gyro and accelerometer as sensor_msgs/Imu; a covariance of −1 means that there is no orientation."""
    none = np.zeros((3, 3)).ravel()
    return make(
        "sensor_msgs/Imu",
        header(motion.time, BASE),
        make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0),
        np.array([-1.0, *none[1:]]),
        _vector(motion.gyro),
        none,
        _vector(motion.accelerometer),
        none,
    )


def joint_states(time: float, names: Sequence[str], position: Values, speed: Values) -> Message:
    """Angles in rad and speeds in rad/s of joints as sensor_msgs/JointState."""
    return make("sensor_msgs/JointState", header(time, BASE), list(names), position, speed, np.zeros(0))


def clock(time: float) -> Message:
    """The simulated time, s, as rosgraph_msgs/Clock."""
    return make("rosgraph_msgs/Clock", stamp(time))


def labelled_cloud(time: float, points: Points, labels: Labels) -> Message:
    """Points with their labels as sensor_msgs/PointCloud2."""
    return cloud(time, MAP, dict(zip("xyz", points.T.astype(np.float32), strict=True)) | {"label": labels})


def cloud(time: float, frame: str, columns: Mapping[str, NDArray]) -> Message:
    """Points as sensor_msgs/PointCloud2; ``columns``: (N,) values by the name of the field, x, y and z in m."""
    layout = np.dtype([(name, values.dtype) for name, values in columns.items()])
    data = np.empty(len(next(iter(columns.values()))), layout)
    for name, values in columns.items():
        data[name] = values
    fields = [
        POINT_FIELD(name, offset, FIELD_TYPES[kind], 1) for name, (kind, offset, *_) in (layout.fields or {}).items()
    ]
    size, raw = layout.itemsize, data.view(np.uint8)
    return make(
        "sensor_msgs/PointCloud2", header(time, frame), 1, len(data), fields, False, size, len(raw), raw, True
    )


def occupancy_grid(time: float, grid: Grid, values: NDArray[np.int8]) -> Message:
    """Values (nx, ny) of a grid in ``map``, 0 (free) to 100 (occupied) or -1 (unknown), as nav_msgs/OccupancyGrid."""
    origin = pose(from_rotation(np.eye(3), [*grid.origin, 0.0]))
    nx, ny = values.shape
    info = make("nav_msgs/MapMetaData", stamp(time), grid.cell, nx, ny, origin)
    return make("nav_msgs/OccupancyGrid", header(time, MAP), info, np.ascontiguousarray(values.T, np.int8).ravel())


def marker(time: float, name: str, kind: str, points: Places, size: float, colour: str) -> Message:
    """A ``SPHERE_LIST`` or ``LINE_LIST`` of points, with a size in m and a CSS colour."""
    form: Any = TYPES["visualization_msgs/msg/Marker"]
    return form(
        header=header(time, MAP),
        ns=name,
        id=0,
        type=getattr(form, kind),
        action=form.ADD if len(points) else form.DELETE,
        pose=pose(np.eye(4)),
        scale=_vector([size] * 3 if kind == "SPHERE_LIST" else [size, 0, 0]),
        color=make("std_msgs/ColorRGBA", *(part / 255 for part in ImageColor.getrgb(colour)), 1.0),
        lifetime=make("builtin_interfaces/Duration", 0, 0),
        frame_locked=False,
        points=[make("geometry_msgs/Point", *place) for place in points.tolist()],
        colors=[],
        texture_resource="",
        texture=compressed_image(time, "", NOTHING),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=make("visualization_msgs/MeshFile", "", NOTHING),
        mesh_use_embedded_materials=False,
    )
