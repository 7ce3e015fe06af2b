"""Bags: what is read of them, and what is wrong with them."""

import weakref
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.convert import convert
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from pipeline.datasets import ros_bag
from pipeline.datasets.messages import seconds
from pipeline.datasets.recording import Recording
from pipeline.datasets.ros_bag import LABEL_TOPIC, read_ros_bag
from pipeline.errors import InputError
from pipeline.frame import Calibration, Intrinsics
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.topics import ImageFormat
from pipeline.robot import Velocity
from pipeline.transforms import from_rotation, inverse, transform_points
from tests.pipeline.datasets import recorded_room
from tests.pipeline.datasets.recorded_room import ODOMETRY, SQLITE, TO_ROS_1, WAY, Change, frames, unchanged, without

DEPTH, COLOUR, INFO = "/camera/depth/image_raw", "/camera/color/image_raw", "/camera/depth/camera_info"
COLOUR_INFO = "/camera/color/camera_info"


NUMBER = 4
"""Frames of the drive that are enough for a bag."""


def write_bag(path: Path, images: ImageFormat = "32FC1", change: Change = unchanged) -> Path:
    return recorded_room.write_bag(path, images, change, NUMBER)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bag") / "room")


def assert_whole(recording: Recording, depth: float = 0.0, rgb: float = 0.0) -> None:
    """The frames are those of the drive, up to errors of ``depth``, m, and of the mean ``rgb``, grey levels."""
    for frame, true in zip(recording.frames(), frames()[:NUMBER], strict=True):
        assert frame.time == true.time
        assert frame.intrinsics == true.intrinsics
        np.testing.assert_allclose(frame.T_base_camera, true.T_base_camera, atol=1e-12)
        np.testing.assert_allclose(frame.depth, true.depth, rtol=1e-6, atol=depth)
        assert np.abs(frame.rgb.astype(int) - true.rgb).mean() <= rgb
        np.testing.assert_array_equal(frame.label, true.label)


def test_what_was_written_comes_back(bag: Path) -> None:
    recording = read_ros_bag(bag)
    assert_whole(recording)
    assert recording.odometry is not None and recording.truth is not None and recording.up is not None
    np.testing.assert_allclose(recording.odometry.poses, ODOMETRY[:NUMBER], atol=1e-12)
    np.testing.assert_allclose(recording.truth.poses, WAY[:NUMBER], atol=1e-12)
    np.testing.assert_allclose(recording.up, [0, 0, 1], atol=1e-12)
    assert recording.has_camera_pose and recording.keyframes is None


def test_whole_millimetres_and_jpeg_come_back(tmp_path: Path) -> None:
    assert_whole(read_ros_bag(write_bag(tmp_path / "room", "16UC1-jpeg")), depth=0.00051, rgb=3)


def test_sqlite_ros_1_and_a_lone_file_are_read_as_well(bag: Path, tmp_path: Path) -> None:
    assert_whole(read_ros_bag(Path(copytree(bag, tmp_path / "room.bag"))))
    convert([bag], tmp_path / "sqlite", **SQLITE)
    assert_whole(read_ros_bag(tmp_path / "sqlite"))
    convert([bag], tmp_path / "ros1.bag", **TO_ROS_1)
    assert_whole(read_ros_bag(tmp_path / "ros1.bag"))
    (file,) = bag.glob("*.mcap")
    assert_whole(read_ros_bag(file))


def recoded(encoding: str) -> Change:
    """Depth or colour as a camera's driver may send it."""

    def change(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        depth = message.data.view(np.float32).reshape(240, 320) if topic == DEPTH else None
        colour = message.data.reshape(240, 320, 3) if topic == COLOUR else None
        if encoding == "compressedDepth" and depth is not None:
            png = cv2.imencode(".png", np.rint(depth * 1000).astype(np.uint16))[1].ravel()
            data = np.concatenate([np.zeros(12, np.uint8), png])
            yield f"{topic}/compressedDepth", time, messages.compressed_image(time, "16UC1; compressedDepth", data)
        elif encoding == "inverse" and depth is not None:
            a, b = 20000.0, 5.0
            with np.errstate(divide="ignore"):
                pixels = np.where(depth > 0, a / depth + b, 0).astype(np.uint16)
            head = np.frombuffer(b"\0\0\0\0" + np.array([a, b], np.float32).tobytes(), np.uint8)
            data = np.concatenate([head, cv2.imencode(".png", pixels)[1].ravel()])
            name = "32FC1; compressedDepth png"
            yield f"{topic}/compressedDepth", time, messages.compressed_image(time, name, data)
        elif encoding in ("png", "tiff", "bare png") and depth is not None:
            ending = "." + encoding.split()[-1]
            data = cv2.imencode(ending, np.rint(depth * 1000).astype(np.uint16))[1].ravel()
            name = "16UC1; compressedDepth png" if encoding == "bare png" else f"16UC1; {encoding} compressed "
            yield f"{topic}/compressed", time, messages.compressed_image(time, name, data)
        elif encoding == "mono16" and depth is not None:
            yield topic, time, messages.image(time, "mono16", np.rint(depth * 1000).astype(np.uint16))
        elif encoding == "big_endian" and depth is not None:
            message = messages.image(time, "16UC1", np.rint(depth * 1000).astype(">u2"))
            message.is_bigendian = 1
            yield topic, time, message
        elif encoding == "padded" and colour is not None:
            message = messages.image(time, "rgb8", np.pad(colour, ((0, 0), (0, 4), (0, 0))))
            message.width = 320
            yield topic, time, message
        elif encoding == "rgba8" and colour is not None:
            yield topic, time, messages.image(time, "rgba8", np.dstack([colour, colour[..., :1]]))
        elif encoding == "bgr8" and colour is not None:
            yield topic, time, messages.image(time, "bgr8", colour[..., ::-1])
        else:
            yield topic, time, message

    return change


@pytest.mark.parametrize(
    "encoding",
    ["mono16", "big_endian", "compressedDepth", "png", "tiff", "bare png", "inverse", "padded", "rgba8", "bgr8"],
)
def test_other_encodings_are_read(encoding: str, tmp_path: Path) -> None:
    error = 0.00065 if encoding == "inverse" else 0.00051
    assert_whole(read_ros_bag(write_bag(tmp_path / "room", change=recoded(encoding))), depth=error)


def changed(topic: str, **values: Any) -> Change:
    """One topic's messages with other values."""

    def change(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        for key, value in values.items() if name == topic else ():
            setattr(message, key, value)
        yield name, time, message

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without(DEPTH), r"no depth images .*/camera/color/image_raw \(rgb8\)"),
        (changed(DEPTH, encoding="8UC1"), r"no depth images .*16UC1.*/camera/depth/image_raw \(8UC1\)"),
        (without(DEPTH, COLOUR), r"no depth images.* /camera/color/camera_info"),
        (without(INFO, COLOUR_INFO), r"camera_info.*--intrinsics"),
        (changed(INFO, k=np.zeros(9)), r"fx fy cx cy must be positive and finite, not 0 0 0 0"),
        (changed(INFO, d=np.ones(3)), r"distortion coefficients, not 3"),
        (changed(INFO, d=np.ones(7)), r"distortion coefficients, not 7"),
        (changed(INFO, d=np.ones(4), distortion_model="equidistant"), r"'equidistant'"),
    ],
)
def test_a_bag_without_what_is_needed_is_refused(change: Change, message: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "room", change=change)
    with pytest.raises(InputError, match=message):
        read_ros_bag(path)


def jpeg_depth(form: str) -> Change:
    """Depth as a JPEG of 8 bits, with the header of compressed_depth_image_transport if ``form`` says so."""

    def change(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name != DEPTH:
            return [(name, time, message)]
        pixels = np.clip(60 * message.data.view(np.float32).reshape(240, 320), 0, 255).astype(np.uint8)
        header = np.zeros(12 * ("compressedDepth" in form), np.uint8)
        data = np.concatenate([header, cv2.imencode(".jpg", pixels)[1].ravel()])
        return [(f"{name}/compressed", time, messages.compressed_image(time, form, data))]

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed(COLOUR, encoding="nv12"), r"'nv12'"),
        (jpeg_depth("16UC1; jpeg compressed "), r"'16UC1; jpeg compressed '.* PNG"),
        (jpeg_depth("16UC1; compressedDepth jpeg"), r"compressedDepth jpeg.* PNG"),
        (changed(DEPTH, height=999), r"pixels"),
        (changed(INFO, width=2**31, d=np.ones(5)), r"320 × 240 .* 2147483648 × 240"),
        (changed(INFO, width=640, height=480), r"320 × 240 .* 640 × 480"),
    ],
)
def test_images_that_cannot_be_used_are_named(change: Change, message: str, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "room", change=change)
    with pytest.raises(InputError, match=message):
        next(read_ros_bag(path).frames())


def test_intrinsics_can_be_given(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "room", change=without(INFO, COLOUR_INFO))
    k = frames()[0].intrinsics
    calibration = Calibration(k.fx, k.fy, k.cx - 0.5, k.cy - 0.5)
    assert next(read_ros_bag(path, calibration=calibration).frames()).intrinsics == k


def test_order_is_restored_and_doubles_are_left_out(tmp_path: Path) -> None:
    def mixed(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        # Written in the order of other times than those of the images, and every second depth image twice.
        yield topic, time + (0.35 if topic == DEPTH and round(time * 10) == 1 else 0), message
        if topic == DEPTH and round(time * 10) % 2 == 0:
            yield topic, time, message

    recording = read_ros_bag(write_bag(tmp_path / "room", change=mixed))
    assert_whole(recording)
    assert recording.left_out == {"depth images with the same timestamp as another": 2}


def test_other_clocks_are_noticed(tmp_path: Path) -> None:
    def later(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if topic == "/odom":
            message.header.stamp.sec += 10**9
        yield topic, time, message

    path = write_bag(tmp_path / "room", change=later)
    with pytest.raises(InputError, match=r"do not overlap.* 0\.00 .* odometry from 1000000000"):
        next(read_ros_bag(path).frames())


def test_odometry_is_taken_from_tf_where_it_has_no_topic(tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", change=without("/odom")))
    assert recording.odometry is not None
    np.testing.assert_allclose(recording.odometry.poses, ODOMETRY[:NUMBER], atol=1e-12)


def renamed(topic: Callable[[str], str], frame: Callable[[str], str] = str, *left_out: str) -> Change:
    """Topics and frames of other names."""

    def change(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name.startswith("/ground_truth") or name == LABEL_TOPIC:
            return [(name, time, message)]
        for part in (*getattr(message, "transforms", ()), message):
            if hasattr(part, "header"):
                part.header.frame_id = frame(part.header.frame_id)
            if hasattr(part, "child_frame_id"):
                part.child_frame_id = frame(part.child_frame_id)
        return [] if name in left_out else [(topic(name), time, message)]

    return change


def called(depth: str, colour: str) -> Change:
    """Other names of the images, with the camera_info beside them."""
    names = {DEPTH: depth, COLOUR: colour}
    infos = {INFO: depth.rpartition("/")[0] + "/camera_info", COLOUR_INFO: colour.rpartition("/")[0] + "/camera_info"}
    return renamed(lambda name: (names | infos).get(name, name))


@pytest.mark.parametrize("topics", [[], ["depth"], ["colour"], ["depth", "colour"]])
@pytest.mark.parametrize(
    ("depth", "colour"),
    [
        ("/depth_camera/depth/image_raw", "/depth_camera/image_raw"),
        ("/rgbd/points_of/image", "/rgbd_depth/colour/image"),
        ("/oak/stereo/image_raw", "/oak/rgb/image_raw"),
        ("/oak/stereo/image_raw", "/oak/depth_aligned_rgb/image_raw"),
    ],
)
def test_the_encoding_says_what_is_depth(depth: str, colour: str, topics: list[str], tmp_path: Path) -> None:
    names = {"depth": depth, "colour": colour}
    recording = read_ros_bag(
        write_bag(tmp_path / "room", change=called(depth, colour)), [names[kind] for kind in topics]
    )
    assert_whole(recording)
    assert not recording.notes


def thermal(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """An infrared camera of 16 bits, and a picture of the depth in false colours."""
    yield name, time, message
    if name == DEPTH:
        yield "/thermal/image_raw", time, messages.image(time, "mono16", np.full((120, 160), 30000, np.uint16))
        yield "/camera/depth/colored", time, messages.image(time, "rgb8", np.zeros((240, 320, 3), np.uint8))


def two_depths(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """Depth of the infrared camera beside depth that is registered to colour."""
    yield name, time, message
    if name == DEPTH:
        yield "/own_depth/image", time, messages.image(time, "32FC1", np.ones((100, 100), np.float32))
    if name == INFO:
        yield "/own_depth/camera_info", time, messages.camera_info(time, Intrinsics(100, 100, 80, 80, 50, 50))


@pytest.mark.parametrize(("change", "notes"), [(thermal, 2), (two_depths, 1)])
def test_of_several_images_the_cameras_or_the_names_decide_and_it_is_said(
    change: Change, notes: int, tmp_path: Path
) -> None:
    path = write_bag(tmp_path / "room", change=change)
    recording = read_ros_bag(path)
    assert_whole(recording)
    assert len(recording.notes) == notes and all("--topics" in note for note in recording.notes)
    assert not read_ros_bag(path, [DEPTH, COLOUR]).notes


def test_depth_without_any_colour_is_said(tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", change=without(COLOUR, COLOUR_INFO)))
    (note,) = recording.notes
    assert "no colour images" in note and not next(recording.frames()).rgb.any()


def footprint(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """Odometry of ``base_footprint``, which no transform connects with the rest."""
    if name == "/odom":
        message.child_frame_id = "base_footprint"
    return [] if name == "/tf" else [(name, time, message)]


def raised(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """A robot whose ``base_link`` is 0.2 m above its ``base_footprint``."""
    up = from_rotation(np.eye(3), [0, 0, 0.2])
    if name == "/odom":
        message.pose.pose.position.z += 0.2
    if name == "/tf_static":
        camera = inverse(up) @ frames()[0].T_base_camera
        message = messages.transforms(
            time, {("base_link", "camera_optical"): camera, ("base_footprint", "base_link"): up}
        )
    return [] if name == "/tf" else [(name, time, message)]


@pytest.mark.parametrize(
    "change",
    [
        raised,
        renamed(lambda name: f"/j100_0001{name}"),
        renamed(lambda name: f"/j100_0001{name}" if "tf" in name else name),
        renamed(str, lambda frame: f"robot1/{frame}"),
        renamed(str, lambda frame: f"robot1/{frame}", "/odom"),
        renamed(str, lambda frame: f"robot1_{frame}", "/odom"),
        renamed(lambda name: f"/robot1{name}", lambda frame: f"/robot1/{frame}", "/odom"),
        footprint,
    ],
    ids=["raised", "namespace", "of_tf", "prefix", "prefix_tf", "underscore_tf", "both_tf", "footprint"],
)
def test_other_names_of_topics_and_frames_change_nothing(change: Change, tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", change=change))
    assert_whole(recording)
    assert recording.odometry is not None and recording.up is not None and recording.has_camera_pose
    np.testing.assert_allclose(recording.odometry.poses, ODOMETRY[:NUMBER], atol=1e-12)
    np.testing.assert_allclose(recording.up, [0, 0, 1], atol=1e-12)
    assert [("base_footprint" in note) for note in recording.notes] == [True] * (change is footprint)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without("/tf_static"), ["base_link", "camera_optical", "odom → base_link"]),
        (without("/odom", "/tf_static"), ["base_link", "camera_optical"]),
        (renamed(str, lambda frame: {"odom": "world"}.get(frame, frame), "/odom"), ["odometry", "world → base_link"]),
    ],
)
def test_what_is_not_found_is_said_with_what_was_there(change: Change, said: list[str], tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", change=change))
    (note,) = recording.notes
    assert all(word in note for word in said) and "\n" not in note


def test_of_several_robots_transforms_must_be_named_where_it_is_not_clear_which(tmp_path: Path) -> None:
    def twice(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        return [(f"/{robot}{name}", time, message) for robot in "ab"] if "tf" in name else [(name, time, message)]

    path = write_bag(tmp_path / "room", change=twice)
    recording = read_ros_bag(path)
    assert not recording.has_camera_pose
    assert any("/b/tf_static" in note and "--topics" in note for note in recording.notes)
    assert read_ros_bag(path, ["/b/tf", "/b/tf_static"]).has_camera_pose


def unstamped(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    if "/image" in name:
        message.header.stamp.sec = message.header.stamp.nanosec = 0
    return [(name, time, message)]


def test_images_without_stamps_count_as_taken_when_they_were_recorded(tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", change=unstamped))
    assert_whole(recording)
    (note,) = recording.notes
    assert "no timestamp (0)" in note
    assert recording.left_out == {}


def test_poses_that_are_none_are_left_out_and_said(tmp_path: Path) -> None:
    def lost(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name == "/odom" and time == 0.1:
            message.pose.pose.position.x = np.nan
        if name == "/imu" and time == 0.1:
            message.linear_acceleration.x = np.nan
        return [(name, time, message)]

    recording = read_ros_bag(write_bag(tmp_path / "room", change=lost))
    assert recording.odometry is not None
    np.testing.assert_allclose(recording.odometry.poses, [ODOMETRY[0], *ODOMETRY[2:NUMBER]], atol=1e-12)
    np.testing.assert_allclose(recording.up, [0, 0, 1], atol=1e-12)
    (note,) = recording.notes
    assert "odometry: ignoring 1 of 4" in note


def test_the_topics_of_realsenses_viewer_are_read(tmp_path: Path) -> None:
    def viewers(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        depth, colour = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"
        names = {
            DEPTH: f"{depth}/image/data", INFO: f"{depth}/info/camera_info",
            COLOUR: f"{colour}/image/data", COLOUR_INFO: f"{colour}/info/camera_info",
        }  # fmt: skip
        infrared = "/device_0/sensor_0/Infrared_1/image/data"
        return [(names.get(name, name), time, message)] + [(infrared, time, message)] * (name == COLOUR)

    recording = read_ros_bag(write_bag(tmp_path / "room", change=viewers))
    assert_whole(recording)
    assert not recording.notes


def test_the_streams_of_realsenses_viewer_are_registered_by_their_extrinsics(tmp_path: Path) -> None:
    depth, colour = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"
    T_colour_depth = from_rotation(Rotation.from_euler("y", 1, degrees=True).as_matrix(), [0.015, 0.0, 0.0])

    def viewers(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        names = {
            DEPTH: f"{depth}/image/data", INFO: f"{depth}/info/camera_info",
            COLOUR: f"{colour}/image/data", COLOUR_INFO: f"{colour}/info/camera_info",
        }  # fmt: skip
        if name in names:
            message.header.frame_id = "0"  # of all streams
        if name == COLOUR_INFO:
            message.k = message.k * np.array([1.5, 1, 1, 1, 1.5, 1, 1, 1, 1])
        if time == 0.0 and name == DEPTH:
            yield f"{depth}/tf/0", time, transform(np.eye(4))
            yield f"{colour}/tf/0", time, transform(T_colour_depth)
        if name not in ("/tf", "/tf_static", "/odom"):
            yield names.get(name, name), time, message

    recording = read_ros_bag(write_bag(tmp_path / "room", change=viewers))
    frame, true = next(recording.frames()), frames()[0]
    assert any(depth[1:] in note and colour[1:] in note for note in recording.notes)
    found = transform_points(inverse(T_colour_depth), frame.points(np.eye(4)))
    assert len(found) > 10_000
    distance, _ = KDTree(true.points(np.eye(4))).query(found)
    assert np.quantile(distance, 0.95) < 0.03


def transform(T: np.ndarray) -> Any:
    """A pose as a Transform."""
    make, q = messages.make, Rotation.from_matrix(T[:3, :3]).as_quat()
    return make(
        "geometry_msgs/Transform", make("geometry_msgs/Vector3", *T[:3, 3]), make("geometry_msgs/Quaternion", *q)
    )


def test_several_inertial_sensors_are_said(tmp_path: Path) -> None:
    def twice(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        return [(name, time, message)] + [("/camera/imu", time, message)] * (name == "/imu")

    path = write_bag(tmp_path / "room", change=twice)
    recording = read_ros_bag(path)
    assert recording.up is None and "/camera/imu" in recording.notes[0]
    assert read_ros_bag(path, ["/imu"]).up is not None


def rectified(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
    """Rectified images, whose camera_info tells the raw camera's distortion and matrix."""
    if name in (INFO, COLOUR_INFO):
        message.d, message.k = (
            np.array([0.1, -0.2, 0.0, 0.0, 0.0]),
            message.k * np.array([1.1, 1, 1, 1, 1, 1, 1, 1, 1]),
        )
    colours = "image_rect_color" if "color" in name else "image_rect"
    return [(name if name == LABEL_TOPIC else name.replace("image_raw", colours), time, message)]


@pytest.mark.parametrize("images", ["32FC1", "32FC1-jpeg"])
def test_rectified_images_are_not_straightened_again(images: ImageFormat, tmp_path: Path) -> None:
    recording = read_ros_bag(write_bag(tmp_path / "room", images, rectified))
    assert_whole(recording, rgb=3 if images.endswith("jpeg") else 0)
    assert not recording.notes


def test_depth_of_another_camera_is_registered_to_colour(tmp_path: Path) -> None:
    def two_cameras(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name.startswith("/camera/"):
            message.header.frame_id = "color" if "color" in name else "depth"
        if name == COLOUR_INFO:
            message.k = message.k * np.array([1.5, 1, 1, 1, 1.5, 1, 1, 1, 1])
        if name == "/tf_static":
            T, beside = frames()[0].T_base_camera, from_rotation(np.eye(3), [0.05, 0, 0])
            message = messages.transforms(time, {("base_link", "depth"): T, ("depth", "color"): beside})
        return [(name, time, message)]

    recording = read_ros_bag(write_bag(tmp_path / "room", change=two_cameras))
    frame, true = next(recording.frames()), frames()[0]
    assert frame.intrinsics.fx == pytest.approx(1.5 * true.intrinsics.fx)
    np.testing.assert_allclose(frame.T_base_camera[:3, 3] - true.T_base_camera[:3, 3], [0, -0.05, 0], atol=1e-9)
    assert any("color" in note and "depth" in note for note in recording.notes)
    # The points are where they were, as far as the colour camera sees them: each on a surface of the room.
    found = frame.points(frame.T_base_camera)
    assert len(found) > 10_000
    distance, _ = KDTree(true.points(true.T_base_camera)).query(found)
    assert np.quantile(distance, 0.95) < 0.03


def test_topics_of_a_kind_must_be_named(tmp_path: Path) -> None:
    def twice(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        yield topic, time, message
        if topic == "/odom":
            yield "/odometry/filtered", time, message

    path = write_bag(tmp_path / "room", change=twice)
    with pytest.raises(InputError, match=r"/odom, /odometry/filtered.*--topics"):
        read_ros_bag(path)
    assert read_ros_bag(path, ["/odom"]).odometry is not None
    with pytest.raises(InputError, match="/elsewhere"):
        read_ros_bag(path, ["/elsewhere"])


def test_a_distorted_image_is_straightened(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "room", change=changed(INFO, d=np.array([0.1, 0.0, 0.0, 0.0, 0.0])))
    frame = next(read_ros_bag(path).frames())
    assert not np.array_equal(frame.depth, frames()[0].depth)
    # In the middle of the image there is no distortion.
    np.testing.assert_array_equal(frame.depth[118:122, 158:162], frames()[0].depth[118:122, 158:162])


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_bag_that_is_cut_short_is_one_line(bag: Path, share: float, tmp_path: Path) -> None:
    (file,) = bag.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
    with pytest.raises(InputError, match=r"cut.mcap: ") as raised:
        list(read_ros_bag(cut).frames())
    assert "\n" not in str(raised.value)


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("[]")
    with pytest.raises(InputError, match=tmp_path.name):
        read_ros_bag(tmp_path)
    with pytest.raises(InputError, match="nowhere"):
        read_ros_bag(tmp_path / "nowhere")


def test_an_accelerometer_that_measures_gravity_downwards_is_turned_round(tmp_path: Path) -> None:
    def inverted(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name == "/imu":
            message.linear_acceleration.z *= -1
        return [(name, time, message)]

    recording = read_ros_bag(write_bag(tmp_path / "room", change=inverted))
    np.testing.assert_allclose(recording.up, [0, 0, 1], atol=1e-12)
    (note,) = recording.notes
    assert "downwards" in note


def test_a_bag_names_its_camera(tmp_path: Path) -> None:
    def viewer(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        """A camera of which RealSense's viewer records the name."""
        yield from renamed(str, lambda frame: frame.replace("camera_optical", "lens"))(name, time, message)
        if name == INFO:
            for key, value in (("Serial Number", "d415"), ("Name", "Intel RealSense D455")):
                yield "/device_0/info", time, messages.make("diagnostic_msgs/KeyValue", key, value)

    recording = read_ros_bag(write_bag(tmp_path / "room", change=viewer))
    assert recording.sensor is not None and recording.sensor.farthest == pytest.approx(5.1)
    assert any("D455" in note for note in recording.notes)


def test_a_bag_may_name_no_camera(tmp_path: Path) -> None:
    change = renamed(str, lambda frame: frame.replace("camera_optical", "lens"))
    assert read_ros_bag(write_bag(tmp_path / "room", change=change)).sensor is None


def test_keyframes_are_found_at_times_since_1970(tmp_path: Path) -> None:
    nanoseconds = (210_000, 250_000_000, 500_290_000, 999_790_000)

    def since_1970(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        stamp = messages.make("builtin_interfaces/Time", 1_700_000_000, nanoseconds[round(time / 0.1)])
        for part in (*getattr(message, "transforms", ()), message):
            if hasattr(part, "header"):
                part.header.stamp = stamp
        yield topic, time, message
        if topic == DEPTH:
            yield "/keyframe", time, messages.pose_stamped(seconds(stamp), "map", np.eye(4))

    recording = read_ros_bag(write_bag(tmp_path / "room", change=since_1970))
    assert recording.keyframes == {frame.time: False for frame in recording.frames()}


def with_foreign(topic: str, foreign: Any) -> Change:
    """A message of another origin on one of the topics of sarsim's own bags."""

    def change(name: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        if name not in (topic, "/ground_truth/pose"):
            yield name, time, message
        if name == DEPTH:
            yield topic, time, foreign

    return change


@pytest.mark.parametrize("topic", ["/ground_truth/pose", "/keyframe", LABEL_TOPIC])
def test_a_topic_of_sarsims_name_but_of_another_type_is_ignored(topic: str, tmp_path: Path) -> None:
    foreign = messages.velocity_stamped(0.0, Velocity())
    recording = read_ros_bag(write_bag(tmp_path / "room", change=with_foreign(topic, foreign)))
    assert recording.truth is None and recording.keyframes is None
    assert len(list(recording.frames())) == NUMBER


def test_keyframes_that_belong_to_no_image_are_ignored_and_it_is_said(tmp_path: Path) -> None:
    foreign = messages.pose_stamped(7.5, "map", np.eye(4))
    recording = read_ros_bag(write_bag(tmp_path / "room", change=with_foreign("/keyframe", foreign)))
    assert recording.keyframes is None
    (note,) = recording.notes
    assert "/keyframe" in note


def test_images_are_not_kept_while_none_of_the_other_kind_arrives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def goes_on(topic: str, time: float, message: Any) -> Iterable[tuple[str, float, Any]]:
        yield topic, time, message
        if topic == COLOUR and time == 0:
            for later in range(1, 41):
                yield topic, later, replace(message, header=messages.header(later, message.header.frame_id))

    path = write_bag(tmp_path / "room", change=goes_on)
    images: list[Any] = []
    kept: list[int] = []

    class Watched(ros_bag.AnyReader):
        """Counts the images that still exist whenever one is read."""

        def deserialize(self, raw: Any, msgtype: str) -> Any:
            message = super().deserialize(raw, msgtype)
            images.append(weakref.ref(message))
            kept.append(sum(image() is not None for image in images))
            return message

    recording = read_ros_bag(path)
    monkeypatch.setattr(ros_bag, "AnyReader", Watched)
    assert [frame.time for frame in recording.frames()] == [frame.time for frame in frames()[:NUMBER]]
    assert len(images) > 40 and max(kept) < 20
