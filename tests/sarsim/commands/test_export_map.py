"""The command that writes an episode's map for other programs."""

from dataclasses import replace

import cv2
import numpy as np
import open3d
import pytest
import yaml

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from pipeline.map_file import save_keyframes
from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import load_metric_map, save_metric_map
from pipeline.metric_map.metric_map import MetricMap
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.ply import write_ply
from sarsim.commands.export_map import export_map
from sarsim.robots.names import robot_file
from tests.pipeline.metric_map.io.octomap_files import colours, log_odds, read_bt, read_ot
from tests.pipeline.polygon_scene import floor, look, pose, wall, wedge
from tests.pipeline.robot_model import PIONEER


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


BOX = np.array([-1, -1, 1]), (4, 4, 6)
"""First index and shape of a box around the map."""


def test_an_octree_has_the_classes_and_the_voxels(episode):
    export_map(episode, episode / "map.ot")
    tree, metric_map = read_ot(episode / "map.ot"), load_metric_map(episode / "metric_map.npz")
    np.testing.assert_array_equal(colours(tree, metric_map), [COLOURS[Label.WALL]] * 6)
    assert (log_odds(tree, *BOX) > 0).sum() == 6


def test_a_binary_octree_has_the_voxels(episode):
    export_map(episode / "metric_map.npz", episode / "map.bt")
    known = log_odds(read_bt(episode / "map.bt"), *BOX)
    assert ((known > 0).sum(), (known < 0).sum()) == (6, 2)


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_how_far_an_octree_is_off_the_map_is_said(ending, episode, capsys):
    export_map(episode, episode / f"map{ending}")
    (line,) = [line for line in capsys.readouterr().out.splitlines() if " add " in line]
    shift = [float(word) for word in line.partition(" add ")[2].split()[:3]]
    centres = load_metric_map(episode / "metric_map.npz").occupied_centres()
    indices = np.argwhere(log_odds((read_bt if ending == ".bt" else read_ot)(episode / f"map{ending}"), *BOX) > 0)
    voxel = load_metric_map(episode / "metric_map.npz").voxel_size
    places = (indices + BOX[0] + 0.5) * voxel + shift
    np.testing.assert_allclose(sorted(places.tolist()), sorted(centres.tolist()), atol=1e-6)


def test_a_cloud_has_the_centres_in_the_colour_of_their_class(episode):
    export_map(episode, episode / "map.ply")
    cloud = open3d.io.read_point_cloud(str(episode / "map.ply"))
    assert len(cloud.points) == 6
    np.testing.assert_array_equal(np.rint(255 * np.asarray(cloud.colors)), [COLOURS[Label.WALL]] * 6)


def test_a_slice_shows_what_is_as_high_as_the_robot(episode, capsys):
    export_map(episode, episode / "map.pgm", (0.25, 0.65))
    assert f"{episode / 'map.pgm'}, {episode / 'map.yaml'}" in capsys.readouterr().out
    image = cv2.imread(str(episode / "map.pgm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(image, [[254, 254], [0, 0]])
    assert (episode / "map.yaml").exists()


def test_a_flat_map_is_the_ground_as_the_robot_judges_it(episode, capsys):
    mapper = Mapper(PIONEER, TruthClassifier())
    T_base_camera = pose(0.1, 0, 0.65, 0, 0.3)
    scene = [floor(-2, 6, -3, 3), wall((2.2, 2.3), (2.2, -2.3)), *wedge(1.2, 0.3, 0.8, 1.0, 0.17)]
    frame = replace(look(scene, T_base_camera, 0.0, 0), T_base_camera=T_base_camera, T_odom_base=np.eye(4))
    mapper.add_frame(mapper.localise(frame), set_down=True)
    save_keyframes(mapper, episode / "keyframes.npz")
    export_map(episode, episode / "map.pgm")
    image = cv2.imread(str(episode / "map.pgm"), cv2.IMREAD_UNCHANGED)
    (x, y, _), cell = yaml.safe_load((episode / "map.yaml").read_text())["origin"], 0.05

    def at(u, v, reach=1):
        return image[::-1][int((v - y) / cell), int((u - x) / cell) : int((u - x) / cell) + reach].min()

    assert (at(0, 0), at(1.6, 0), at(2.1, 0.8, 5)) == (254, 254, 0)  # the floor, the ramp, the wall
    files = ", ".join(str(episode / name) for name in ("map.pgm", "map.yaml", "map_cost.png", "map_cost.yaml"))
    assert capsys.readouterr().out == f"Wrote {files}\n"
    timid = robot_file("pioneer3at").read_text().replace('"0.3490658503988659"', '"0.1"')  # rad that it climbs
    (episode / "timid.xml").write_text(timid)
    export_map(episode, episode / "timid.pgm", robot=str(episode / "timid.xml"))
    steep = cv2.imread(str(episode / "timid.pgm"), cv2.IMREAD_UNCHANGED)
    assert (steep[image == 0] == 0).all() and np.count_nonzero(steep == 0) > 100 + np.count_nonzero(image == 0)
    for name in ("map.tif", "map.png"):
        export_map(episode, episode / name)
        np.testing.assert_array_equal(cv2.imread(str(episode / name), cv2.IMREAD_UNCHANGED), image)


def test_without_a_semantic_map_there_are_no_classes(episode):
    (episode / "semantic_map.ply").unlink()
    export_map(episode, episode / "map.ot")
    tree, metric_map = read_ot(episode / "map.ot"), load_metric_map(episode / "metric_map.npz")
    np.testing.assert_array_equal(colours(tree, metric_map), [COLOURS[Label.UNLABELLED]] * 6)


def test_what_cannot_be_done_is_refused(episode, tmp_path):
    with pytest.raises(InputError, match=r"map\.xyz"):
        export_map(episode, episode / "map.xyz")
    with pytest.raises(InputError, match=r"keyframes\.npz: .*--heights"):
        export_map(episode, episode / "map.pgm")
    with pytest.raises(InputError, match=r"keyframes\.npz"):
        export_map(episode, episode / "map.tif")
    with pytest.raises(InputError, match=r"--heights 0.25 0.65: .*\.pgm"):
        export_map(episode, episode / "map.tif", (0.25, 0.65))
    with pytest.raises(InputError, match=r"--heights 0\.65 0\.25"):
        export_map(episode, episode / "map.pgm", (0.65, 0.25))
    with pytest.raises(InputError, match=r"none\.npz"):
        export_map(episode / "none.npz", episode / "map.bt")
    write_ply(episode / "semantic_map.ply", np.zeros((1, 3), "f4"), np.zeros((1, 3), "u1"), np.array([99], "u1"))
    with pytest.raises(InputError, match=r"semantic_map\.ply: .*labels"):
        export_map(episode, episode / "map.ot")
    (episode / "semantic_map.ply").write_text("not a cloud")
    with pytest.raises(InputError, match="label"):
        export_map(episode, episode / "map.ot")
