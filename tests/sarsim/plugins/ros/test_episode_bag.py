"""The bag of an episode, and its sequence as the TUM RGB-D benchmark has them."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from evo.core.metrics import APE, PoseRelation, StatisticsType
from evo.core.sync import associate_trajectories
from evo.tools.file_interface import read_tum_trajectory_file
from rosbags.highlevel import AnyReader

from pipeline.datasets.replay import Replay, localisation_of
from pipeline.datasets.ros_bag import read_ros_bag
from pipeline.datasets.tum_folder import read_tum_folder
from pipeline.mapper import Mapper
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.episode import Episode
from sarsim.plugins.ros.plugin import BagConfig
from sarsim.settings import EpisodeConfig


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("bag")
    bag = BagConfig(folder / "bag", images="32FC1")
    places = {name: folder / name for name in ("out", "tum")}
    config = EpisodeConfig(labels="truth", detector=None, steps=2, plugins={"bag": bag}, **places)
    episode = Episode(config)
    assert episode.run()
    return episode


def test_every_topic_is_there(episode: Episode) -> None:
    with AnyReader([episode.config.plugins["bag"].path]) as reader:
        kinds = {name: topic.msgtype.split("/")[-1] for name, topic in reader.topics.items() if topic.msgtype}
        count = Counter({name: topic.msgcount for name, topic in reader.topics.items()})
    assert {kind: sorted(name for name in kinds if kinds[name] == kind) for kind in set(kinds.values())} == {
        "CameraInfo": ["/camera/color/camera_info", "/camera/depth/camera_info"],
        "Image": ["/camera/color/image_raw", "/camera/depth/image_raw", "/camera/label/image_raw"],
        "PoseStamped": ["/ground_truth/pose", "/keyframe"],
        "Path": ["/path", "/plan"],
        "TFMessage": ["/tf", "/tf_static"],
        "Clock": ["/clock"],
        "Imu": ["/imu"],
        "JointState": ["/joint_states"],
        "MarkerArray": ["/markers"],
        "OccupancyGrid": ["/map"],
        "Odometry": ["/odom"],
        "PointCloud2": ["/semantic_cloud"],
        "Twist": ["/cmd_vel"],
    }
    mapper = episode.explorer.mapper
    assert count["/keyframe"] == len(mapper.keyframes)
    labelled = [seen for seen in mapper.keyframes.observations if seen.top_two_classes is not None]
    assert count["/semantic_cloud"] == sum(len(seen.points) > 0 for seen in labelled)
    assert count["/map"] == count["/plan"] == episode.explorer.steps == 2
    assert count["/odom"] == count["/tf"] == count["/ground_truth/pose"] >= count["/imu"]
    assert count["/tf_static"] == 1


def test_mapped_again_it_gives_the_maps_of_the_episode(episode: Episode) -> None:
    recording = read_ros_bag(episode.config.plugins["bag"].path)
    mapper = Mapper(episode.robot.model, TruthClassifier(), localisation=localisation_of("slam"))
    for _ in Replay(recording, mapper, "slam"):
        pass
    mapper.apply_corrections()
    theirs = episode.explorer.mapper
    np.testing.assert_allclose(mapper.keyframes.poses, theirs.keyframes.poses, atol=1e-6)
    np.testing.assert_array_equal(mapper.metric_map.occupied_centres(), theirs.metric_map.occupied_centres())
    assert recording.left_out == {}
    assert cloud_of(mapper.semantic_map) == cloud_of(theirs.semantic_map)


def rows(path: Path) -> list[list[str]]:
    """As the benchmark's associate.py reads a list: words of each line but those of comments."""
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def test_the_sequence_is_what_tools_of_the_benchmark_read(episode: Episode) -> None:
    folder = episode.config.tum
    assert folder is not None
    lists = {name: rows(folder / f"{name}.txt") for name in ("rgb", "depth", "label")}
    assert len(lists["rgb"]) == len(lists["depth"]) == len(lists["label"]) >= len(episode.explorer.mapper.keyframes)
    true, dead = (read_tum_trajectory_file(str(folder / f"{name}.txt")) for name in ("groundtruth", "odometry"))
    # So associate.py does: the nearest pose of at most 0.02 s from an image.
    for stamp, name in lists["depth"]:
        assert np.abs(true.timestamps - float(stamp)).min() < 0.02
        assert (folder / name).is_file()
    error = APE(PoseRelation.translation_part)
    error.process_data(associate_trajectories(true, dead))
    assert len(error.error) == true.num_poses
    assert 0 < error.get_statistic(StatisticsType.max) < 0.5  # wheels slip
    felt = np.array(rows(folder / "accelerometer.txt"), float)
    assert felt.shape == (len(rows(folder / "gyroscope.txt")), 4) and (np.diff(felt[:, 0]) > 0).all()
    assert abs(np.median(felt[:, 3]) - 9.81) < 0.2  # along z, on the floor
    assert {"README.md", "LICENSE", "labels.csv", "intrinsics.json"} <= {path.name for path in folder.iterdir()}


def test_the_sequence_mapped_again_gives_the_maps_of_the_episode(episode: Episode) -> None:
    assert episode.config.tum is not None
    recording = read_tum_folder(episode.config.tum)
    assert recording.keyframes is not None and len(recording.steps) == episode.explorer.steps
    # Labels are images of their own, which the benchmark knows nothing of.
    labels = [
        cv2.imread(str(episode.config.tum / name), cv2.IMREAD_UNCHANGED)
        for _, name in rows(episode.config.tum / "label.txt")
    ]
    frames = [replace(frame, label=label) for frame, label in zip(recording.frames(), labels, strict=True)]
    mapper = Mapper(episode.robot.model, TruthClassifier(), localisation=localisation_of("slam"))
    for _ in Replay(replace(recording, frames=lambda: iter(frames)), mapper, "slam"):
        pass
    mapper.apply_corrections()
    theirs = episode.explorer.mapper
    np.testing.assert_allclose(mapper.keyframes.poses, theirs.keyframes.poses, atol=0.002)
    again, before = (set(map(tuple, m.metric_map.occupied_centres().tolist())) for m in (mapper, theirs))
    assert len(again & before) > 0.98 * max(len(again), len(before))
    assert recording.left_out == {}


def cloud_of(semantic_map: SemanticMap) -> set[tuple[int, ...]]:
    """Points in tenths of a millimetre, and their labels."""
    points = np.rint(semantic_map.points() * 1e4).astype(int)
    return set(map(tuple, np.column_stack([points, semantic_map.labels()]).tolist()))
