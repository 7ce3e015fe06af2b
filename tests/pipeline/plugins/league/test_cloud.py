import numpy as np
import open3d
import pytest

from pipeline.plugins.league.cloud import NORMAL, read_cloud
from pipeline.transforms import inverse, transform_points
from tests.pipeline.plugins.league.handed_in_room import T_MAP_LEAGUE, hand_in_room, room_points

HEADER = """\
ply
format ascii 1.0
comment team: Team, 'B'
comment start time: 2026-01-26 14:30:00
comment mission: lab
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return hand_in_room(tmp_path_factory.mktemp("room"))[1]


def test_others_read_the_cloud(path):
    assert path.read_text().startswith(HEADER)
    cloud = open3d.io.read_point_cloud(str(path))
    np.testing.assert_allclose(
        np.asarray(cloud.points), transform_points(inverse(T_MAP_LEAGUE), room_points()), atol=6e-4
    )
    np.testing.assert_allclose(np.asarray(cloud.colors), 200 / 255)
    assert len(cloud.normals) == len(room_points())


def test_normals_point_to_where_the_robot_was(path):
    normals, points = read_cloud(path).rows(NORMAL), room_points()
    is_floor = np.abs(points).max(axis=1) < 1.8
    np.testing.assert_allclose(normals[is_floor & (points[:, 2] == 0)], [[0, 0, 1]] * is_floor.sum(), atol=0.01)
    is_east = (points[:, 0] == 2) & (np.abs(points[:, 1]) < 1.8) & (points[:, 2] > 0.3)
    np.testing.assert_allclose(normals[is_east], [[0, -1, 0]] * is_east.sum(), atol=0.01)


def test_what_is_known_surely_has_more_confidence(path):
    confidence, points = read_cloud(path).columns["confidence"], room_points()
    np.testing.assert_allclose(confidence[points[:, 2] == 0], 0.98)
    np.testing.assert_allclose(confidence[points[:, 2] > 0.5], 0.5)


PLY = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("solid", "PLY"),
        (PLY.replace("ascii", "binary_little_endian"), "ASCII"),
        (PLY.replace("float y", "double y") + "0 0 0\n1 1 1\n", "property y must have the type float, not double"),
        (PLY.replace("float z", "float w") + "0 0 0\n1 1 1\n", "float z"),
        (PLY.replace("vertex 2", "face 2") + "0 0 0\n", "element vertex"),
        (PLY.replace("vertex 2", "vertex " + 5000 * "9") + "0 0 0\n", "element vertex"),
        (PLY.replace("vertex 2", "vertex x 2") + "0 0 0\n", "element vertex"),
        (PLY + "0 0 0\n", "2 vertices with 3 numbers each, but the file has 1 with 3"),
        (PLY + "0 0 0\n0 a 0\n", "vertex must be a line of numbers"),
        (PLY + "0 0 0\n0 nan 0\n", "finite"),
    ],
)
def test_faults_of_form_are_reported(tmp_path, text, fault):
    (tmp_path / "a.ply").write_text(text)
    assert read_cloud(tmp_path / "a.ply").errors[0].count(fault)


def test_a_cloud_in_good_form_has_no_faults(tmp_path):
    (tmp_path / "a.ply").write_text(PLY + "0 0 0\n1 2 3\n")
    read = read_cloud(tmp_path / "a.ply")
    assert read.errors == []
    np.testing.assert_array_equal(read.rows(), [[0, 0, 0], [1, 2, 3]])
