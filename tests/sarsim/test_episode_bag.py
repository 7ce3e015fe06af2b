"""The bag of an episode."""

from collections import Counter

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pipeline.mapper import Mapper
from pipeline.recording.replay import Replay, localisation_of
from pipeline.recording.sources.ros_bag import read_ros_bag
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.episode import Episode
from sarsim.settings import EpisodeConfig


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("bag")
    config = EpisodeConfig(
        labels="truth", detector=None, steps=3, out=folder / "out", bag=folder / "bag", bag_images="32FC1"
    )
    episode = Episode(config)
    assert episode.run()
    return episode


def test_every_topic_is_there(episode: Episode) -> None:
    assert episode.config.bag is not None
    with AnyReader([episode.config.bag]) as reader:
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
    assert count["/keyframe"] == mapper.keyframes
    assert count["/semantic_cloud"] == sum(o.probabilities is not None for o in mapper.observations)
    assert count["/map"] == count["/plan"] == episode.explorer.steps == 3
    assert count["/odom"] == count["/tf"] == count["/ground_truth/pose"] >= count["/imu"]
    assert count["/tf_static"] == 1


def test_mapped_again_it_gives_the_maps_of_the_episode(episode: Episode) -> None:
    assert episode.config.bag is not None
    recording = read_ros_bag(episode.config.bag)
    mapper = Mapper(episode.robot.model, TruthClassifier(), localisation=localisation_of("slam"))
    for _ in Replay(recording, mapper, "slam"):
        pass
    mapper.settle()
    theirs = episode.explorer.mapper
    np.testing.assert_allclose(mapper.poses, theirs.poses, atol=1e-6)
    np.testing.assert_array_equal(mapper.metric_map.occupied_centres(), theirs.metric_map.occupied_centres())
    assert recording.left_out == {}
    assert cloud_of(mapper.semantic_map) == cloud_of(theirs.semantic_map)


def cloud_of(semantic_map: SemanticMap) -> set[tuple[int, ...]]:
    """Points in tenths of a millimetre, and their labels."""
    points = np.rint(semantic_map.points() * 1e4).astype(int)
    return set(map(tuple, np.column_stack([points, semantic_map.labels()]).tolist()))
