"""Whole runs with a lidar: an episode with a bag, and a robot on a network."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.datasets.ros_bag import read_ros_bag
from pipeline.labels import Label
from pipeline.robot import Velocity
from sarsim.arenas.load import load_arena
from sarsim.episode import Episode
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.ros.plugin import BagConfig
from sarsim.plugins.ros.settings import RosRobotConfig
from sarsim.plugins.ros.simulated_node import SimulatedNode
from sarsim.settings import EpisodeConfig, TeleopConfig
from sarsim.teleoperation import MappedDrive
from tests.pipeline.plugins.ros.live.loopback import End, Wire
from tests.recordings import read

LAYOUT = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "intensity")]
    + [("ring", "<u2"), ("time", "<f4")]
    + [("label", "u1"), ("instance", "<i4")]
)
"""What a reader of our clouds expects, whatever we say of it."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the results of an episode of one step, and of its bag."""
    folder = tmp_path_factory.mktemp("lidar")
    plugins = {"bag": BagConfig(folder / "bag"), "lidar": LidarConfig("8x180")}
    config = EpisodeConfig(labels="truth", detector=None, steps=2, plugins=plugins, out=folder / "out")
    assert Episode(config).run()
    return folder


def messages(folder: Path, topic: str) -> list:
    """The messages of a topic of the episode's bag, as Foxglove's own library decodes them."""
    (file,) = (folder / "bag").glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages(topics=[topic])]


def test_the_bag_has_the_scans_of_the_sequence(folder: Path) -> None:
    clouds = messages(folder, "/points")
    sequence = folder / "out/lidar/sequences/00"
    files = sorted((sequence / "velodyne").iterdir())
    assert 10 < len(clouds) == len(files) == len(np.loadtxt(sequence / "times.txt"))
    for cloud, file in zip(clouds, files, strict=True):
        points = np.frombuffer(cloud.data, LAYOUT)
        assert_array_equal(
            np.stack([points[axis] for axis in "xyz"], axis=1), np.fromfile(file, np.float32).reshape(-1, 4)[:, :3]
        )
    assert (points["label"] == Label.WALL).any()
    links = [(t.header.frame_id, t.child_frame_id) for message in messages(folder, "/tf") for t in message.transforms]
    assert links.count(("base_link", "lidar")) == len(clouds)


def test_the_bag_can_still_be_mapped(folder: Path) -> None:
    frames = list(read_ros_bag(folder / "bag").frames())
    assert len(frames) == len(messages(folder, "/camera/depth/image_raw"))


def test_the_report_counts_scans_and_the_recording_shows_them(folder: Path) -> None:
    report = json.loads((folder / "out/report.json").read_text())
    count = len(list((folder / "out/lidar/sequences/00/labels").iterdir()))
    assert report["lidar"]["scans"] == count
    shown = [row for row in read(folder / "out/episode.rrd")["/world/robot/lidar"] if "Points3D:positions" in row]
    assert len(shown) == 2


def test_a_robot_on_a_network_sends_scans() -> None:
    wire = Wire()
    config = RosRobotConfig(plugins={"lidar": LidarConfig("utm-30lx")})
    node = SimulatedNode(config, End(wire, "robot"))
    for _ in range(5):
        node.run_period()
    node.robot.close()
    assert len(wire.heard["/scan"]) == len(wire.heard["/points"]) == 5
    scan = wire.heard["/scan"][-1]
    assert len(scan.ranges) == 1081
    assert np.isfinite(scan.ranges).mean() > 0.9
    assert_allclose(scan.angle_min, -np.radians(135))
    assert "/points" not in _topics_without_a_lidar()


def _topics_without_a_lidar() -> set[str]:
    wire = Wire()
    node = SimulatedNode(RosRobotConfig(), End(wire, "robot"))
    node.run_period()
    node.robot.close()
    return set(wire.heard)


def test_a_drive_by_hand_leaves_scans_and_a_bag(tmp_path: Path) -> None:
    plugins = {"bag": BagConfig(tmp_path / "bag"), "lidar": LidarConfig("4x60")}
    drive = MappedDrive(TeleopConfig(plugins=plugins), load_arena("nist_6x4"), tmp_path / "out")
    for _ in range(10):
        drive.drive(Velocity(0.2))
    drive.save()
    assert len(list((tmp_path / "out/lidar/sequences/00/velodyne").iterdir())) == 5
    assert len(messages(tmp_path, "/points")) == 5


def test_a_robot_on_a_network_takes_no_plugin_that_needs_maps() -> None:
    with pytest.raises(ValueError, match="--bag: this command has no use for it"):
        make_plugins(RosRobotConfig(plugins={"bag": BagConfig(Path("bag"))}), ("add_to_arena", "measurements"))
