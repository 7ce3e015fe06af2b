"""The command that writes an episode's map for other programs."""

import cv2
import numpy as np
import open3d
import pytest

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.io.npz import save_metric_map
from pipeline.metric_map.io.octomap import read_octomap
from pipeline.metric_map.metric_map import MetricMap
from pipeline.semantic_map.ply import write_ply
from sarsim.scripts.export_map import export_map


@pytest.fixture
def episode(tmp_path):
    """A folder with a map of a wall of 2 × 1 × 3 voxels with two free ones before it, and the wall's points."""
    metric_map = MetricMap()
    metric_map.set_log_odds(np.array([0, 0, 2]), np.full((2, 1, 3), 40, np.int8))
    metric_map.set_log_odds(np.array([0, 1, 3]), np.full((2, 1, 1), -9, np.int8))
    save_metric_map(metric_map, tmp_path / "metric_map.npz")
    points = metric_map.occupied_centres()
    labels = np.full(len(points), Label.WALL, np.uint8)
    write_ply(tmp_path / "semantic_map.ply", points, COLOURS[labels], labels)
    return tmp_path


def test_an_octree_has_the_classes_and_the_voxels(episode):
    export_map(episode, episode / "map.ot")
    octree = read_octomap(episode / "map.ot")
    assert set(octree.label[octree.log_odds > 0]) == {Label.WALL}
    assert len(octree.to_metric_map().occupied_centres()) == 6


def test_a_binary_octree_has_the_voxels(episode):
    export_map(episode / "metric_map.npz", episode / "map.bt")
    again = read_octomap(episode / "map.bt").to_metric_map()
    assert (len(again.occupied_centres()), len(again.free_centres())) == (6, 2)


def test_a_cloud_has_the_centres_in_the_colour_of_their_class(episode):
    export_map(episode, episode / "map.ply")
    cloud = open3d.io.read_point_cloud(str(episode / "map.ply"))
    assert len(cloud.points) == 6
    np.testing.assert_array_equal(np.rint(255 * np.asarray(cloud.colors)), [COLOURS[Label.WALL]] * 6)


def test_a_flat_map_shows_what_is_as_high_as_the_robot(episode):
    export_map(episode, episode / "map.pgm")
    image = cv2.imread(str(episode / "map.pgm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(image, [[254, 254], [0, 0]])
    assert (episode / "map.yaml").exists()


def test_without_a_semantic_map_there_are_no_classes(episode):
    (episode / "semantic_map.ply").unlink()
    export_map(episode, episode / "map.ot")
    assert not read_octomap(episode / "map.ot").label.any()


def test_what_cannot_be_done_is_refused(episode, tmp_path):
    with pytest.raises(InputError, match="ending"):
        export_map(episode, episode / "map.xyz")
    with pytest.raises(InputError, match=r"none\.npz"):
        export_map(episode / "none.npz", episode / "map.bt")
    (episode / "semantic_map.ply").write_text("not a cloud")
    with pytest.raises(InputError, match="label"):
        export_map(episode, episode / "map.ot")
