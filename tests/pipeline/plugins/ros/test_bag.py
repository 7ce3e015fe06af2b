"""Bags that are written, as other readers have them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from pipeline.datasets.messages import pose_matrix, seconds
from pipeline.errors import InputError
from pipeline.grid_map import Grid
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.bag import Bag
from pipeline.transforms import from_yaw
from tests.pipeline.datasets.recorded_room import frames, write_bag

POINTS = np.array([[0.5, 1.0, -2.0], [3.0, 4.0, 5.5]], np.float32)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of a drive, with one message of each other kind."""
    path = tmp_path_factory.mktemp("bag") / "room"
    others = {
        "/map": messages.occupancy_grid(9.5, Grid(np.array([-2, 4]), 0.5, (2, 3)), np.arange(6).reshape(2, 3)),
        "/semantic_cloud": messages.labelled_cloud(9.5, POINTS, np.array([1, 6], np.uint8)),
        "/path": messages.path(9.5, POINTS.astype(float)),
        "/nodes": messages.marker(9.5, "nodes", "SPHERE_LIST", POINTS.astype(float), 0.1, "red"),
        "/joint_states": messages.joint_states(9.5, ["a", "b"], np.zeros(2), np.ones(2)),
    }
    written = dict(others)

    def change(topic: str, time: float, message: Any) -> Any:
        yield topic, time, message
        while others:
            name, other = others.popitem()
            yield name, 9.5, other

    write_bag(path, change=change)
    assert not others and written
    return path


def plain(message: Any) -> Any:
    """A message of either reader as lists and numbers."""
    if isinstance(message, np.ndarray):
        return message.tolist()
    if isinstance(message, (bytes, memoryview)):
        return list(message)
    if isinstance(message, (list, tuple)):
        return [plain(item) for item in message]
    if hasattr(message, "__slots__") or hasattr(message, "__dataclass_fields__"):
        names = getattr(message, "__dataclass_fields__", None) or message.__slots__
        return {name: plain(getattr(message, name)) for name in names if name.islower() and not name.startswith("_")}
    return message


def test_rosbags_and_mcap_read_every_message_alike(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        ours = [(c.topic, t, plain(reader.deserialize(raw, c.msgtype))) for c, t, raw in reader.messages()]
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        decoded = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        theirs = [(channel.topic, message.log_time, plain(content)) for _, channel, message, content in decoded]
    assert len(ours) == len(theirs) > 100

    def place(row: tuple[str, int, Any]) -> tuple[str, int]:
        return row[0], row[1]

    for one, other in zip(sorted(ours, key=place), sorted(theirs, key=place), strict=True):
        assert one == other, one[:2]


def test_a_grid_lies_where_its_cells_are(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        (found,) = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages() if c.topic == "/map"]
    info: Any = found.info  # type: ignore[attr-defined]
    assert (info.width, info.height, info.resolution) == (2, 3, 0.5)
    assert (info.origin.position.x, info.origin.position.y) == (-1.0, 2.0)
    # Row by row along x.
    assert found.data.tolist() == [0, 3, 1, 4, 2, 5]  # type: ignore[attr-defined]


def test_times_and_poses_come_back() -> None:
    for time in (0.0, 0.04, 1234567.000001, 1.8e9):
        assert messages.seconds(messages.stamp(time)) == pytest.approx(time, abs=1e-9)
    T = from_yaw(1.0, 2.0, 3.0, 2.5)
    found = messages.pose(T)
    np.testing.assert_allclose(pose_matrix(found.position, found.orientation), T, atol=1e-12)
    found.orientation.w = found.orientation.z = 0.0
    assert np.isnan(pose_matrix(found.position, found.orientation)).all()


def test_a_time_of_a_message_is_the_same_once_it_is_sent_again() -> None:
    rng = np.random.default_rng(0)
    for whole, nanosec in zip([0, 3600, 1_700_000_000] * 300, rng.integers(0, 10**9, 900).tolist(), strict=True):
        time = seconds(messages.make("builtin_interfaces/Time", whole, nanosec))
        assert seconds(messages.stamp(time)) == time


def test_intrinsics_are_those_of_ros() -> None:
    k = frames()[0].intrinsics
    info = messages.camera_info(0.0, k)
    point = np.array([0.3, -0.2, 2.0])
    u, v, w = info.p.reshape(3, 4) @ [*point, 1]
    (row, column), _ = (values[0] for values in k.project(point[None]))
    # In ROS a pixel is the square around its whole number.
    assert (round(v / w), round(u / w)) == (row, column)


def test_a_bag_overwrites_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=tmp_path.name):
        Bag(tmp_path)
    with pytest.raises(InputError, match="/proc/bag"):
        Bag(Path("/proc/bag"))
